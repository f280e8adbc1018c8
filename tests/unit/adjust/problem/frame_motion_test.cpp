#include "adjust/problem/frame_motion.h"

#include <gtest/gtest.h>

#include <cmath>

namespace megablock {
namespace {

// Frames on a path, with a pose each.
struct Path {
  Block block;
  std::vector<Pose> poses;

  void add(double time_s, const Eigen::Vector3d& place, double heading = 0, std::int64_t pass = 0) {
    Frame frame;
    frame.rig = RigIndex(0);
    frame.time_s = time_s;
    frame.pass = pass;
    block.frames.push_back(frame);
    // The rig turns with its heading: ground -> rig is the inverse of the turn of its axes.
    poses.push_back({Eigen::Quaterniond(Eigen::AngleAxisd(-heading, Eigen::Vector3d::UnitZ())), place});
  }
  std::optional<Motion> motion(std::int64_t frame) {
    block.rigs.resize(1);
    return FramePaths(block).motion(FrameIndex(frame), [&](FrameIndex f) { return &poses[f.value]; });
  }
};

TEST(FrameMotion, IsThatOfACircle) {
  Path path;
  constexpr double kRadius = 50, kRate = 0.1;  // metres, radians per second
  for (int i = 0; i < 9; ++i) {
    const double t = 0.5 * i + 0.01 * (i % 2), angle = kRate * t;
    path.add(1000.25 + t, {kRadius * std::cos(angle), kRadius * std::sin(angle), 7}, angle);
  }
  const double angle = kRate * 2.0;
  const Motion motion = path.motion(4).value();
  const Eigen::Vector3d velocity = kRadius * kRate * Eigen::Vector3d(-std::sin(angle), std::cos(angle), 0);
  EXPECT_LT((motion.velocity - velocity).norm(), 0.003 * velocity.norm());
  EXPECT_LT((motion.turn - Eigen::Vector3d(0, 0, kRate)).norm(), 0.003 * kRate);
  // At its end the path is known on one side.
  EXPECT_LT((path.motion(0)->velocity - Eigen::Vector3d(0, kRadius * kRate, 0)).norm(), 0.03 * kRadius * kRate);
  EXPECT_EQ(path.motion(0)->turn.norm(), 0);
}

TEST(FrameMotion, DoesNotTurnWhereOnlyThePathOrTheAttitudesDo) {
  Path sideways, scattered;
  for (int i = 0; i < 5; ++i) {
    sideways.add(0.5 + i, {10 * std::cos(0.1 * i), 10 * std::sin(0.1 * i), 0}, 0);
    scattered.add(0.5 + i, {10.0 * i, 0, 0}, i % 2 == 0 ? 0.01 : -0.01);
  }
  EXPECT_LT(sideways.motion(2)->turn.norm(), 1e-9);
  EXPECT_LT(scattered.motion(2)->turn.norm(), 1e-9);
}

TEST(FrameMotion, KeepsItsSpeedWhereTimesAreWholeSeconds) {
  Path path;
  for (int i = 0; i < 30; ++i) path.add(std::floor(1000 + 1.7 * i), {0, 8 * 1.7 * i, 0});  // 8 m/s
  for (const std::int64_t frame : {0, 7, 15, 29})
    EXPECT_LT((path.motion(frame)->velocity - Eigen::Vector3d(0, 8, 0)).norm(), 0.06 * 8) << frame;
}

TEST(FrameMotion, DoesNotCutTheCornerOfANextLine) {
  Path path;  // two lines in opposite directions, without numbers of lines: the turn takes 12 seconds
  for (int i = 0; i < 5; ++i) path.add(0.5 + 2 * i, {20.0 * i, 0, 100});
  for (int i = 0; i < 5; ++i) path.add(20.5 + 2 * i, {80 - 20.0 * i, 40, 100});
  EXPECT_LT((path.motion(4)->velocity - Eigen::Vector3d(10, 0, 0)).norm(), 1e-9);
  EXPECT_LT((path.motion(5)->velocity - Eigen::Vector3d(-10, 0, 0)).norm(), 1e-9);
}

TEST(FrameMotion, IsUnknownWithoutTimesOrNeighbours) {
  Path path;
  path.add(std::nan(""), {0, 0, 0});
  path.add(1.5, {1, 0, 0});
  path.add(100.5, {2, 0, 0});
  for (const std::int64_t frame : {0, 1, 2}) EXPECT_FALSE(path.motion(frame)) << frame;
}

TEST(FrameMotion, IsAskedForOnlyWithARollingShutter) {
  Block block;
  block.cameras.resize(2);
  EXPECT_FALSE(paths_for_rolling_shutters(block));
  block.cameras[CameraIndex(1)].readout_s = 0.02;
  EXPECT_TRUE(paths_for_rolling_shutters(block));
}

}  // namespace
}  // namespace megablock
