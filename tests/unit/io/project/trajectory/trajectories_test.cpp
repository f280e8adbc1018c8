// Tests what a trajectory makes of its poses: observations, start values and relative poses.
#include "io/project/trajectory/trajectories.h"

#include <gmock/gmock.h>

#include <cmath>

#include "geometry/numbers/angles.h"
#include "geometry/transform/pose.h"
#include "geometry/transform/rotation.h"
#include "io/base/error.h"
#include "tests/support/io/image_files.h"
#include "tests/support/io/small_result.h"

namespace megablock {
namespace {

using fixture::message_of;
using ::testing::HasSubstr;
using ::testing::SizeIs;

const Eigen::Vector3d kArm(0.1, -0.6, -0.2);

// The four frames of a small block, 3 m apart on a bend, 2 s from one to the next.
class TrajectoriesTest : public ::testing::Test {
 protected:
  TrajectoriesTest() {
    trajectories_.sources.resize(1);
    for (int f = 0; f < 4; ++f) {
      Trajectories::ObservedPose pose;
      pose.frame = FrameIndex(f);
      pose.local = {3.0 * f, 0.2 * f * f, 1};
      pose.rotation = rotation_exp<double>(Eigen::Vector3d(0.1, 0.2 * f, -0.3)).normalized();
      pose.sigma_m = {0.02, 0.05};
      pose.sigma_deg = {0.03, 0.03};
      pose.pass = 7;
      pose.time_s = 100 + 2 * f;
      trajectories_.poses.push_back(pose);
    }
    block_.ground = {};
    block_.relative_poses.clear();
  }
  TrajectorySource& source() { return trajectories_.sources[0]; }
  const Frame& frame(int f) const { return block_.frames[FrameIndex(f)]; }

  Trajectories trajectories_;
  Block block_ = fixture::small_result().block;
};

TEST_F(TrajectoriesTest, ObservePositionsAndAttitudes) {
  trajectories_.poses[2].sigma_m = {kNoNumber, kNoNumber};
  trajectories_.poses[3].sigma_deg = {kNoNumber, kNoNumber};
  trajectories_.set_positions({}, 0.5, kArm, block_);
  trajectories_.set_attitudes({}, block_);
  ASSERT_TRUE(frame(1).position_prior && frame(1).attitude_prior);
  EXPECT_EQ(frame(1).position_prior->position, trajectories_.poses[1].local);
  EXPECT_EQ(frame(1).position_prior->sigma, Eigen::Vector3d(0.02, 0.02, 0.5)) << "the project's goes before the file's";
  EXPECT_EQ(frame(1).position_prior->lever_arm, kArm);
  EXPECT_EQ(frame(1).attitude_prior->rotation_cw.coeffs(), trajectories_.poses[1].rotation->coeffs());
  EXPECT_EQ(frame(1).attitude_prior->sigma_rad, Eigen::Vector3d::Constant(0.03 * kDegree));
  EXPECT_FALSE(frame(2).position_prior) << "no sigma, no observation";
  EXPECT_TRUE(frame(2).attitude_prior);
  EXPECT_FALSE(frame(3).attitude_prior);
}

TEST_F(TrajectoriesTest, StartWhereTheLeverArmPutsTheRig) {
  source().lever_arm = kArm;
  trajectories_.set_starts(Eigen::Vector3d::Zero(), block_);
  const Pose& start = *frame(2).given_pose;
  EXPECT_LT((start.centre + start.rotation.conjugate() * kArm - trajectories_.poses[2].local).norm(), 1e-12);
  EXPECT_EQ(frame(2).pass, 7);
  EXPECT_EQ(frame(2).time_s, 104);
  EXPECT_TRUE(block_.relative_poses.empty());
}

// A frame without a pose has the time of its header, of another clock.
TEST_F(TrajectoriesTest, TakeTimesOnlyWhereAllFramesHaveOne) {
  const double before = block_.frames[FrameIndex(2)].time_s = 1e9;
  trajectories_.poses.pop_back();
  trajectories_.set_starts(Eigen::Vector3d::Zero(), block_);
  EXPECT_EQ(frame(2).time_s, before);
  EXPECT_EQ(frame(2).pass, 7);
}

// White noise of each pose and a random walk between: over 3 m and 2 s.
TEST_F(TrajectoriesTest, RelativePosesHaveTheSigmasOfTheDrift) {
  source().relative = DriftModel{0.005, 0.002, 0.01, 0.02, 50, 60};
  source().lever_arm = kArm;
  trajectories_.set_starts(Eigen::Vector3d::Zero(), block_);
  ASSERT_THAT(block_.relative_poses, SizeIs(3));
  const RelativePose& relative = block_.relative_poses[1];
  EXPECT_EQ(relative.from, FrameIndex(1));
  EXPECT_EQ(relative.to, FrameIndex(2));
  const Pose &a = *frame(1).given_pose, &b = *frame(2).given_pose;
  EXPECT_LT((a.centre + a.rotation.conjugate() * relative.pose.centre - b.centre).norm(), 1e-12);
  EXPECT_LT(rotation_angle(relative.pose.rotation * a.rotation, b.rotation), 1e-12);
  const double distance = (b.centre - a.centre).norm();
  EXPECT_NEAR(relative.position_sigma_m, std::sqrt(0.005 * 0.005 + distance * 0.002 * 0.002), 1e-15);
  EXPECT_NEAR(relative.rotation_sigma_rad, kDegree * std::sqrt(0.01 * 0.01 + 2 * 0.02 * 0.02), 1e-15);
}

TEST_F(TrajectoriesTest, RelativePosesEndAtGapsAndPasses) {
  source().relative = DriftModel{0.005, 0, 0.01, 0, 50, 60};
  trajectories_.poses[1].pass = 8;
  trajectories_.poses[3].time_s += 61;
  block_.relative_poses.push_back({FrameIndex(0), FrameIndex(3), {}, 1, 1});
  trajectories_.set_starts(Eigen::Vector3d::Zero(), block_);
  EXPECT_TRUE(block_.relative_poses.empty()) << "7, 8, 7 and a gap of 63 s; that of the block gives way";
}

TEST_F(TrajectoriesTest, OnEarthNeedABlockOnEarth) {
  for (auto& pose : trajectories_.poses)
    pose.geodetic = Geodetic{48.1, 11.5 + 1e-5 * static_cast<double>(pose.frame.value), 545};
  EXPECT_THAT(message_of<InputError>([&] { trajectories_.set_positions({}, {}, kArm, block_); }),
              HasSubstr("add 'origin' to the project file"));
  // A hundred kilometres from the origin the vertical differs by almost a degree.
  block_.ground = {true, 49, 11.5, 500, "EPSG:4979"};
  trajectories_.set_positions({}, {}, kArm, block_);
  trajectories_.set_attitudes({}, block_);
  const Georeference reference(block_.ground);
  EXPECT_LT((frame(3).position_prior->position - reference.to_local(*trajectories_.poses[3].geodetic)).norm(), 1e-9);
  EXPECT_NEAR(rotation_angle(frame(0).attitude_prior->rotation_cw, *trajectories_.poses[0].rotation) / kDegree, 0.9,
              0.01);
}

TEST(AttitudeSigmas, TurnFromTheGroundToTheRig) {
  // Axes right, down, ahead of a rig that looks along the horizon: the heading turns about its y axis.
  const Eigen::Quaterniond level = rotation_from(YawPitchRoll{0.7, 0, 0});
  EXPECT_LT((attitude_sigmas(level, 0.01, 0.2) - Eigen::Vector3d(0.01, 0.2, 0.01)).norm(), 1e-12);
  EXPECT_EQ(attitude_sigmas(level, 0.03, 0.03), Eigen::Vector3d::Constant(0.03));
}

}  // namespace
}  // namespace megablock
