// Calibration of the simulated vehicle from mounts that are off by 5 mm and 0.5 degrees: against the truth.
#include "merge/rig/rig_calibration.h"

#include <gmock/gmock.h>

#include <cmath>
#include <numbers>

#include "io/base/error.h"
#include "io/simulate/blocks/simulate.h"

namespace megablock {
namespace {

using ::testing::HasSubstr;
using Scene = SimulationOptions::Scene;
using Path = SimulationOptions::Path;

SimulationOptions field(Path path, std::int64_t frames) {
  SimulationOptions options = SimulationOptions::of(Scene::kTargetField, path);
  options.frames = frames;
  options.vehicle_seed = 7;
  return options;
}

CalibratedRig calibrate(const SimulatedBlock& s, const RigCalibrationOptions& options,
                        const std::optional<VerificationSite>& site = {}) {
  return calibrate_rig(s.block, initial_state(s.block), s.tracks, options, site);
}

// Of the mounts' errors over their sigmas, scale of the rig apart when the network is free.
double normalised_error(const CalibratedRig& rig, const SimulatedBlock& s) {
  double sum = 0, n = 0;
  for (const MountCalibration& m : rig.calibration.mounts) {
    if (m.held) continue;
    const Pose& truth = s.truth.mounts[m.rig][static_cast<std::size_t>(m.mount)];
    PoseIncrement d;
    d << rotation_log<double>(truth.rotation.conjugate() * m.pose.rotation), m.pose.centre - truth.centre;
    sum += d.cwiseAbs2().cwiseQuotient(m.covariance.diagonal()).sum();
    n += 6;
  }
  return std::sqrt(sum / n);
}

void expect_noise(const RigCalibration& c, double noise) {
  EXPECT_NEAR(c.after.images.rms_px(), expected_rms_px(c, noise), 0.05 * expected_rms_px(c, noise));
  EXPECT_GT(c.before.images.rms_px(), 5 * c.after.images.rms_px());
  EXPECT_EQ(c.refused, "");
}

TEST(RigCalibration, OffLineOnFourPanoramas) {
  SimulationOptions simulation = field(Path::kLoop, 4);
  simulation.points_per_frame = 10;  // not used
  const SimulatedBlock s = simulate_block(simulation);
  RigCalibrationOptions options;
  options.mode = CalibrationMode::kOffLine;
  options.mounts = MountFreedom::kFree;
  const CalibratedRig rig = calibrate(s, options);
  expect_noise(rig.calibration, 0.5);
  EXPECT_NEAR(normalised_error(rig, s), 1, 0.35);  // 54 correlated components
  ASSERT_TRUE(rig.calibration.after.check_points);
  EXPECT_LT(rig.calibration.after.check_points->rms_m, 0.02);
  EXPECT_LT(rig.calibration.after.check_points->normalised, 1.5);
  EXPECT_EQ(rig.calibration.points, 77) << "check points alone";
}

// Judged as published: on another site with a few control points, the rig held as calibrated.
TEST(RigCalibration, OnLineFromTiePointsAlone) {
  SimulationOptions simulation = field(Path::kS, 12);
  simulation.points_per_frame = 200;
  simulation.control_points = simulation.check_points = 0;
  const SimulatedBlock s = simulate_block(simulation);
  SimulationOptions other = field(Path::kLoop, 8);
  other.seed = 3;
  other.points_per_frame = 60;
  other.control_points = 6;
  other.check_points = 92;
  const SimulatedBlock site = simulate_block(other);
  RigCalibrationOptions options;
  options.mode = CalibrationMode::kOnLine;
  const CalibratedRig rig = calibrate(s, options, VerificationSite{site.block, site.tracks});
  expect_noise(rig.calibration, 0.5);
  EXPECT_NEAR(normalised_error(rig, s), 1, 0.35);
  ASSERT_TRUE(rig.calibration.verification && rig.calibration.verification->check_points);
  EXPECT_EQ(rig.calibration.verification->check_points->points, 92);
  EXPECT_LT(rig.calibration.verification->check_points->rms_m, 0.02);
  EXPECT_LT(rig.calibration.verification->check_points->normalised, 1.5);
  EXPECT_GT(rig.calibration.verification_before->check_points->rms_m, 0.1);
}

// A start that is right and measurements that are few and badly spread: what comes out is worse, and is not taken.
TEST(RigCalibration, RefusesWhatIsWorseThanTheStart) {
  SimulationOptions simulation = field(Path::kSparse, 4);
  simulation.mount_position_error_m = simulation.mount_rotation_error_deg = 0;
  simulation.calibrate = false;
  const SimulatedBlock s = simulate_block(simulation);
  SimulationOptions other = field(Path::kLoop, 4);
  other.seed = 3;
  other.points_per_frame = 120;
  other.mount_position_error_m = other.mount_rotation_error_deg = 0;
  other.calibrate = false;
  const SimulatedBlock site = simulate_block(other);
  RigCalibrationOptions options;
  options.mounts = MountFreedom::kFree;
  const CalibratedRig rig = calibrate(s, options, VerificationSite{site.block, site.tracks});
  EXPECT_THAT(rig.calibration.refused, HasSubstr("residuals on the verification site are"));
  ASSERT_TRUE(rig.calibration.verification && rig.calibration.verification_before);
  EXPECT_NEAR(rig.calibration.verification_before->images.rms_px(), 0.5, 0.1);
  const std::string warnings = ::testing::PrintToString(rig.calibration.warnings);
  EXPECT_THAT(warnings, HasSubstr("no measurement takes part; its mount stays at the start"));
  EXPECT_THAT(warnings, HasSubstr("hardly any measurements in the sensor's quadrant"));
}

TEST(RigCalibration, BoundsOfTheSigmasAreWatched) {
  SimulationOptions simulation = field(Path::kS, 8);
  simulation.points_per_frame = 100;
  const SimulatedBlock s = simulate_block(simulation);
  RigCalibrationOptions options;
  options.max_position_sigma_m = 1e-6;
  options.max_rotation_sigma_deg = 1e-6;
  options.held_out_share = 0;
  const RigCalibration c = calibrate(s, options).calibration;
  const std::string warnings = ::testing::PrintToString(c.warnings);
  EXPECT_THAT(warnings, HasSubstr("c22: posterior sigma of its position"));
  EXPECT_THAT(warnings, HasSubstr("degrees (bound 0.000)"));
  EXPECT_EQ(c.held_out, 0);
}

// Ahead and behind, from one standpoint: nothing ties the two cameras to one another.
TEST(RigCalibration, NamesCamerasThatShareNoView) {
  SimulationOptions simulation = field(Path::kSingle, 6);
  simulation.rig_cameras = 2;
  simulation.points_per_frame = 150;
  simulation.control_points = simulation.check_points = 0;
  const SimulatedBlock s = simulate_block(simulation);
  RigCalibrationOptions options;
  options.mode = CalibrationMode::kOnLine;
  options.mounts = MountFreedom::kFree;
  options.adjustment.min_intersection_deg = 0.1;  // half a metre of way, walls 20 m away
  const RigCalibration c = calibrate(s, options).calibration;
  ASSERT_EQ(c.mounts.size(), 2u);
  EXPECT_FALSE(c.mounts[1].position_determined);
  EXPECT_THAT(::testing::PrintToString(c.warnings),
              AllOf(HasSubstr("c42: the measurements do not determine the position"), HasSubstr("Drive curves")));
}

TEST(RigCalibration, IsTheSameEveryTime) {
  SimulationOptions simulation = field(Path::kS, 6);
  simulation.points_per_frame = 60;
  const SimulatedBlock s = simulate_block(simulation);
  const CalibratedRig a = calibrate(s, {}), b = calibrate(s, {});
  for (std::size_t m = 0; m < a.calibration.mounts.size(); ++m) {
    EXPECT_EQ(a.calibration.mounts[m].pose.centre, b.calibration.mounts[m].pose.centre);
    EXPECT_EQ(a.calibration.mounts[m].covariance, b.calibration.mounts[m].covariance);
  }
}

TEST(RigCalibration, SaysWhatIsMissing) {
  const SimulatedBlock s = simulate_block(field(Path::kSparse, 4));
  const auto refusal = [&](CalibrationMode mode, const auto& change) {
    SimulatedBlock changed = s;
    change(changed);
    RigCalibrationOptions options;
    options.mode = mode;
    try {
      calibrate(changed, options);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  const auto nothing = [](SimulatedBlock&) {};
  EXPECT_EQ(refusal(CalibrationMode::kAll, nothing), "");
  EXPECT_THAT(refusal(CalibrationMode::kOffLine, [](SimulatedBlock& b) { b.block.control_points.resize(2); }),
              HasSubstr("2 measured control points: off-line calibration needs at least 3"));
  EXPECT_THAT(refusal(CalibrationMode::kOffLine,
                      [](SimulatedBlock& b) {
                        double along = 0;
                        for (ControlPoint& point : b.block.control_points) {
                          along += 1;
                          point.position << along, 2 * along, 5;
                        }
                      }),
              HasSubstr("lie on one straight line"));
  EXPECT_THAT(refusal(CalibrationMode::kOnLine, [](SimulatedBlock& b) { b.tracks = {{}, {0}, {}, {}, {}, {}}; }),
              HasSubstr("no tie points"));
  EXPECT_THAT(refusal(CalibrationMode::kAll,
                      [](SimulatedBlock& b) {
                        for (Mount& mount : b.block.rigs.front().mounts)
                          mount.position_sigma_m = mount.rotation_sigma_rad = 0;
                      }),
              HasSubstr("all mounts are held by the project"));
  EXPECT_THAT(refusal(CalibrationMode::kAll, [](SimulatedBlock& b) { b.block.rigs.front().mounts.resize(1); }),
              HasSubstr("no rig of two or more cameras"));
}

}  // namespace
}  // namespace megablock
