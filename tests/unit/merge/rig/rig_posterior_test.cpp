// Posterior sigmas of mounts against the inverse of the whole normal equations, and the undetermined parameters of a
// rig.
#include "merge/rig/rig_posterior.h"

#include <gtest/gtest.h>

#include <cmath>

#include "adjust/calibration/rig_observations.h"
#include "io/simulate/blocks/simulate.h"
#include "merge/checks/monolithic.h"

namespace megablock {
namespace {

using Scene = SimulationOptions::Scene;
using Path = SimulationOptions::Path;

WholeBlock at_truth(const SimulatedBlock& simulated, const Block& block) {
  WholeBlock whole = whole_block(block, simulated.truth, simulated.tracks, {});
  whole.state.points = simulated.points;
  if (!block.control_points.empty())
    whole.state.points.insert(whole.state.points.end(), simulated.control_truth.begin(), simulated.control_truth.end());
  return whole;
}

SimulatedBlock field(std::int64_t frames) {
  SimulationOptions options = SimulationOptions::of(Scene::kTargetField, Path::kS);
  options.frames = frames;
  options.rig_cameras = 4;
  options.points_per_frame = 80;
  options.control_points = 20;
  options.check_points = 0;
  return simulate_block(options);
}

double largest_difference(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  const Eigen::VectorXd sigma = b.diagonal().cwiseSqrt();
  return (sigma.cwiseInverse().asDiagonal() * (a - b) * sigma.cwiseInverse().asDiagonal()).cwiseAbs().maxCoeff();
}

TEST(RigPosterior, EqualsTheInverseOfTheWholeNormalEquations) {
  const SimulatedBlock simulated = field(8);
  RigCalibrationOptions options;
  options.mounts = MountFreedom::kFree;
  const WholeBlock whole = at_truth(simulated, calibration_block(simulated.block, options));
  const RigPosterior posterior = rig_posterior(whole.problem, whole.state, false);
  const MonolithicSystem system = monolithic_system(whole.problem, whole.state);
  const Eigen::MatrixXd covariance = monolithic_covariance(system);
  ASSERT_EQ(posterior.mounts.size(), 3u);
  EXPECT_TRUE(posterior.scale_determined);
  for (const auto& mount : posterior.mounts) {
    const std::int64_t column = system.mount_column[static_cast<std::size_t>(mount.mount)];
    EXPECT_LT(largest_difference(mount.covariance, covariance.block<6, 6>(column, column)), 1e-6);
    EXPECT_TRUE(mount.rotation_determined && mount.position_determined);
  }
}

// Tie points alone: the rig may grow about its reference, nothing else is open, and sigmas are those of its shape.
TEST(RigPosterior, TiePointsLeaveTheScaleOfTheRig) {
  const SimulatedBlock simulated = field(8);
  RigCalibrationOptions options;
  options.mode = CalibrationMode::kOnLine;
  options.mounts = MountFreedom::kFree;
  const Block block = calibration_block(simulated.block, options);
  const WholeBlock whole = at_truth(simulated, block);
  const RigPosterior shape = rig_posterior(whole.problem, whole.state, true);
  const RigPosterior all = rig_posterior(whole.problem, whole.state, false);
  EXPECT_FALSE(shape.scale_determined);
  double extent = 0, freed = 0;
  for (std::size_t u = 0; u < shape.mounts.size(); ++u) {
    EXPECT_TRUE(shape.mounts[u].rotation_determined && shape.mounts[u].position_determined);
    EXPECT_LT(std::sqrt(shape.mounts[u].covariance.bottomRightCorner<3, 3>().trace()), 0.01);
    freed += (all.mounts[u].covariance - shape.mounts[u].covariance).bottomRightCorner<3, 3>().trace();
    extent += (whole.state.mounts[u + 1].centre - whole.state.mounts[0].centre).squaredNorm();
  }
  // The scale is known as well as the ties to the start give it: sigma / extent of the rig, in all mounts together
  // sigma.
  const double sigma = block.rigs.front().mounts[1].position_sigma_m;
  EXPECT_NEAR(std::sqrt(freed), sigma, 0.01 * sigma) << "extent " << std::sqrt(extent);
}

// Two cameras, to the left and to the right, on a straight drive without turns: they never see the same point.
WholeBlock apart() {
  constexpr int kFrames = 6, kColumns = 9;
  Block block;
  BlockState state;
  Rig rig{"rig", {}};
  const double quarter = std::acos(0.0);
  for (const double side : {-1.0, 1.0}) {
    Camera camera;
    camera.name = side < 0 ? "left" : "right";
    camera.width = 1000, camera.height = 800;
    camera.intrinsics = {700, 500, 400, 0, 0, 0, 0, 0};
    rig.mounts.push_back({block.cameras.next_index(),
                          {rotation_exp<double>(Eigen::Vector3d(0, -side * quarter, 0)), {0.3 * side, 0, 0}}});
    block.cameras.push_back(camera);
  }
  block.rigs.push_back(rig);
  const Pose level{rotation_exp<double>(Eigen::Vector3d(-quarter, 0, 0)).conjugate(), Eigen::Vector3d::Zero()};
  for (int f = 0; f < kFrames; ++f) {
    Frame frame;
    frame.name = "f" + std::to_string(f);
    frame.rig = RigIndex(0);
    Pose pose = level;
    pose.centre = {0, static_cast<double>(f), 2};
    frame.given_pose = pose;
    block.frames.push_back(frame);
    for (int m = 0; m < 2; ++m) block.add_image(frame.name + "_" + std::to_string(m), {FrameIndex(f), m, 0});
  }
  state = initial_state(block);
  TrackSet tracks;
  tracks.begin.push_back(0);
  std::vector<Eigen::Vector3d> points;
  for (int m = 0; m < 2; ++m)
    for (int i = 0; i < 4 * kColumns; ++i) {
      const Eigen::Vector3d point((m ? 1 : -1) * (8 + i % 3), 0.9 * (i % kColumns) - 1, 0.5 + 1.2 * (i / kColumns));
      const auto before = tracks.observation_count();
      for (int f = 0; f < kFrames; ++f) {
        const Eigen::Vector3d inside =
            to_camera(state.frames[FrameIndex(f)], rig.mounts[static_cast<std::size_t>(m)].pose, point);
        const Eigen::Vector2d pixel = project(block.cameras[CameraIndex(m)].intrinsics, inside);
        if (!pixel.allFinite() || pixel.minCoeff() < 0 || pixel.x() > 1000 || pixel.y() > 800) continue;
        tracks.image.push_back(ImageIndex(2 * f + m));
        tracks.x.push_back(to_fixed_pixel(pixel.x()));
        tracks.y.push_back(to_fixed_pixel(pixel.y()));
        tracks.feature.push_back(-1);
      }
      EXPECT_GE(tracks.observation_count() - before, 2);
      tracks.id.emplace_back(tracks.track_count());
      tracks.begin.push_back(tracks.observation_count());
      points.push_back(point);
    }
  RigCalibrationOptions options;
  options.mode = CalibrationMode::kOnLine;
  options.mounts = MountFreedom::kFree;
  WholeBlock whole = whole_block(calibration_block(block, options), state, tracks, {});
  whole.state.points = points;
  return whole;
}

TEST(RigPosterior, NamesMountsThatNothingTies) {
  const WholeBlock whole = apart();
  const RigPosterior posterior = rig_posterior(whole.problem, whole.state, true);
  ASSERT_EQ(posterior.mounts.size(), 1u);
  EXPECT_FALSE(posterior.mounts[0].position_determined);
  EXPECT_FALSE(posterior.mounts[0].rotation_determined);  // about the direction of the drive
}

}  // namespace
}  // namespace megablock
