// Differences of positions and attitudes that move with the rig, with the ground, and with neither.
#include "io/evaluation/receivers.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "geometry/transform/rotation.h"
#include "io/block/observed_poses.h"

namespace megablock {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

constexpr double kDegree = 3.14159265358979323846 / 180;

// Frames that look down along headings of four directions, tilted by up to `tilt` degrees.
struct SeenFromRig {
  BlockResult result;
  report::Figures figures;
  std::mt19937_64 random{3};

  SeenFromRig(std::int64_t frames, double tilt_deg, bool one_heading = false) {
    std::uniform_real_distribution<double> uniform(-1, 1);
    result.block.rigs.push_back({"drone", {{CameraIndex(0), {}, 0, 0}}});
    for (std::int64_t i = 0; i < frames; ++i) {
      Frame frame;
      frame.name = "f" + std::to_string(i);
      frame.rig = RigIndex(0);
      result.block.frames.push_back(frame);
      const Eigen::Vector3d tilt(uniform(random), uniform(random), 0);
      const double heading = one_heading ? 0 : static_cast<double>(i % 4) * 90 * kDegree;
      result.state.frames.push_back(
          {rotation_exp<double>(tilt_deg * kDegree * tilt) * rotation_exp<double>(Eigen::Vector3d(3.14159, 0, 0)) *
               rotation_exp<double>(Eigen::Vector3d(0, 0, heading)),
           Eigen::Vector3d::Zero()});
    }
  }

  Eigen::Vector3d noise(double sigma) {
    std::normal_distribution<double> error(0, sigma);
    return {error(random), error(random), error(random)};
  }
  // Antennas that are `in_rig` and `in_ground` off.
  void positions(const Eigen::Vector3d& in_rig, const Eigen::Vector3d& in_ground, double sigma = 0.02) {
    figures.positions.clear();
    for (Frame& frame : result.block.frames)
      frame.position_prior = PositionPrior{Eigen::Vector3d::Zero(), Eigen::Vector3d::Constant(sigma)};
    for (FrameIndex f(0); result.state.frames.contains(f); ++f.value)
      figures.positions.push_back({f,
                                   -(result.state.frames[f].rotation.conjugate() * in_rig + in_ground) + noise(sigma),
                                   Eigen::Vector3d::Constant(sigma)});
  }
  void attitudes(const Eigen::Vector3d& in_rig_deg, double sigma_deg = 0.05) {
    figures.attitudes.clear();
    for (Frame& frame : result.block.frames)
      frame.attitude_prior =
          AttitudePrior{Eigen::Quaterniond::Identity(), Eigen::Vector3d::Constant(kDegree * sigma_deg)};
    for (FrameIndex f(0); result.state.frames.contains(f); ++f.value)
      figures.attitudes.push_back(
          {f, -kDegree * in_rig_deg + noise(kDegree * sigma_deg), Eigen::Vector3d::Constant(kDegree * sigma_deg)});
  }
  std::vector<std::string> lines() const { return receiver_remarks(result, figures); }
};

TEST(Receivers, AWrongLeverArmIsNamedWithItsSize) {
  SeenFromRig block(60, 15);
  block.positions({0.30, -0.12, 0.2}, {1, 2, -47});
  ASSERT_EQ(block.lines().size(), 1u);
  const std::string line = block.lines()[0];
  EXPECT_THAT(line, HasSubstr("gps: {lever_arm_sigma_m: 1}"));
  double x = 0, y = 0, z = 0;
  ASSERT_EQ(std::sscanf(line.c_str(), "The antenna lies %lf, %lf, %lf m", &x, &y, &z), 3) << line;
  EXPECT_NEAR(x, 0.30, 0.015);
  EXPECT_NEAR(y, -0.12, 0.015);
  EXPECT_NEAR(z, 0.20, 0.08);
}

// Down and the camera's axis are the same for all: the height says nothing of the lever arm.
TEST(Receivers, OfCamerasThatLookDownOnlyTheHorizontalIsKnown) {
  SeenFromRig block(60, 0);
  block.positions({0.3, 0, 0}, {0, 0, 5});
  ASSERT_EQ(block.lines().size(), 1u);
  EXPECT_THAT(block.lines()[0], HasSubstr(", ? m (sigma "));
  block.positions({0, 0, 0}, {0, 0, 5});
  EXPECT_THAT(block.lines(), IsEmpty());
}

TEST(Receivers, AShiftOfTheDatumIsNoLeverArm) {
  SeenFromRig block(60, 15);
  block.positions({0, 0, 0}, {1, 2, -47});
  EXPECT_THAT(block.lines(), IsEmpty());
  SeenFromRig one(60, 0, true);
  one.positions({0.3, 0.3, 0}, {0, 0, 0});
  EXPECT_THAT(one.lines(), IsEmpty());
}

TEST(Receivers, OutliersChangeNothing) {
  SeenFromRig block(60, 15);
  block.positions({0, 0, 0}, {0, 0, 0});
  for (const std::size_t i : {4u, 8u, 12u, 16u, 20u}) block.figures.positions[i].difference.x() += 50;
  EXPECT_THAT(block.lines(), IsEmpty());
}

// A receiver whose satellites are masked is off by what changes slowly.
TEST(Receivers, ADriftIsNoLeverArm) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    SeenFromRig block(400, 15);
    block.random.seed(seed);
    block.positions({0, 0, 0}, {0, 0, 0});
    Eigen::Vector3d drift = block.noise(0.2);
    for (report::PositionResidual& r : block.figures.positions) r.difference += drift += block.noise(0.02);
    EXPECT_THAT(block.lines(), IsEmpty()) << seed;
  }
}

TEST(Receivers, ABoresightIsNamedUnlessItIsEstimated) {
  SeenFromRig block(60, 15);
  block.attitudes({0.5, -1.5, 0.7});
  ASSERT_EQ(block.lines().size(), 1u);
  EXPECT_THAT(block.lines()[0], HasSubstr("attitude: {boresight_sigma_deg: 5}"));
  double x = 0, y = 0, z = 0;
  ASSERT_EQ(std::sscanf(block.lines()[0].c_str(),
                        "The attitudes are turned against the images by %lf, %lf, %lf degrees", &x, &y, &z),
            3);
  EXPECT_NEAR(x, 0.5, 0.05);
  EXPECT_NEAR(y, -1.5, 0.05);
  block.result.block.rigs[RigIndex(0)].mounts.push_back({CameraIndex(), {}, 0.02, 0});
  EXPECT_THAT(block.lines(), IsEmpty());
}

TEST(Receivers, WhatIsSmallerThanTheStatedSigmaIsNotNamed) {
  SeenFromRig block(60, 15);
  block.attitudes({0.5, 0.5, 0.5}, 3);
  EXPECT_THAT(block.lines(), IsEmpty());
  SeenFromRig few(7, 15);
  few.positions({0.3, 0.3, 0}, {0, 0, 0});
  EXPECT_THAT(few.lines(), IsEmpty());
}

TEST(Receivers, AreShownWithTheGivenLeverArm) {
  SeenFromRig block(1, 0);
  Rig& rig = block.result.block.rigs[RigIndex(0)];
  block.result.block.frames[FrameIndex(0)].position_prior =
      PositionPrior{Eigen::Vector3d::Zero(), Eigen::Vector3d::Ones(), {0.1, -0.6, 0}};
  rig.mounts.push_back({CameraIndex(), {}, 0, 0.1});
  block.result.state.mounts.push_back({Pose{}, Pose{Eigen::Quaterniond::Identity(), {0.2, 0, 0}}});
  block.result.mount_covariance.push_back({BlockResult::Matrix6::Zero(), 1e-4 * BlockResult::Matrix6::Identity()});
  const auto receivers = receivers_of(block.result);
  ASSERT_EQ(receivers.size(), 1u);
  EXPECT_TRUE(receivers[0].lever_arm.isApprox(Eigen::Vector3d(0.3, -0.6, 0)));
  EXPECT_TRUE(receivers[0].boresight_sigma.isZero());
  EXPECT_TRUE(receivers[0].lever_arm_change.isApprox(Eigen::Vector3d(0.2, 0, 0)));
  EXPECT_TRUE(receivers[0].lever_arm_sigma.isApprox(Eigen::Vector3d::Constant(0.01)));
}

// A group that is shifted in height, known to 2 cm.
TEST(Receivers, ShiftsAreShownAlongTheirAxes) {
  SeenFromRig block(1, 0);
  BlockResult& result = block.result;
  result.state.mounts.push_back({Pose{}});
  result.mount_covariance.push_back({BlockResult::Matrix6::Zero()});
  EXPECT_THAT(shifts_of(result), IsEmpty());
  result.block.rigs.push_back(position_group("positions of a.jpg and 8 more", {0, 0, 47}, 470));
  result.state.mounts.push_back({Pose{Eigen::Quaterniond::Identity(), {0.1, 0.2, 46.9}}});
  result.mount_covariance.push_back({4e-4 * BlockResult::Matrix6::Identity()});
  EXPECT_THAT(shifts_of(result), IsEmpty());  // no position belongs to it
  PositionPrior prior;
  prior.group = RigIndex(1);
  prior.shifted = {0, 0, 1};
  result.block.frames[FrameIndex(0)].position_prior = prior;
  const std::vector<ShiftFigures> shifts = shifts_of(result);
  ASSERT_EQ(shifts.size(), 1u);
  EXPECT_EQ(shifts[0].shift, Eigen::Vector3d(0, 0, 46.9));
  EXPECT_LT((shifts[0].sigma - Eigen::Vector3d(0, 0, 0.02)).norm(), 1e-12);
  EXPECT_EQ(shift_text(result, shifts[0]),
            "in the adjusted block the positions of a.jpg and 8 more lie 46.90 m above their places (sigma 0.02 m)");
  result.position_scales = {{RigIndex(1), 4, 1}};
  EXPECT_THAT(shift_text(result, shifts_of(result)[0]),
              HasSubstr("the adjustment used these times 4.0 (horizontal) and 1.0 (height)"));
  EXPECT_THAT(receivers_of(result), IsEmpty());
}

}  // namespace
}  // namespace megablock
