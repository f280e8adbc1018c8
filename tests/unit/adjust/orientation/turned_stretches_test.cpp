#include "adjust/orientation/turned_stretches.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "geometry/numbers/angles.h"
#include "geometry/transform/rotation.h"

namespace megablock {
namespace {

// A pass of 60 frames with exact relative poses; its initial orientation is off by about 0.3 degrees a frame.
struct Pass {
  Block block;
  BlockState truth, initial;

  Pass() {
    std::mt19937 random(5);
    std::normal_distribution<double> gauss;
    block.rigs.push_back({"rig", {Mount()}});
    for (int f = 0; f < 60; ++f) {
      Frame frame;
      frame.rig = RigIndex(0);
      block.frames.push_back(frame);
      const Pose pose{rotation_exp<double>({0.01 * f, 0.3 + 0.02 * f, 0.1}), {4.0 * f, std::sin(0.1 * f), 2}};
      truth.frames.push_back(pose);
      truth.oriented.push_back(1);
      if (f % 2 == 0) {
        PositionPrior prior;
        prior.position = pose.centre;
        prior.sigma.setConstant(0.5);
        block.frames.back().position_prior = prior;
      }
      const Eigen::Vector3d turn(0.003 * gauss(random), 0.003 * gauss(random), 0.003 * gauss(random));
      initial.frames.push_back({rotation_exp<double>(turn) * pose.rotation, pose.centre});
      initial.oriented.push_back(1);
    }
    for (int f = 0; f + 1 < 60; ++f) {
      const Pose &a = truth.frames[FrameIndex(f)], &b = truth.frames[FrameIndex(f + 1)];
      block.relative_poses.push_back({FrameIndex(f), FrameIndex(f + 1),
                                      Pose{b.rotation * a.rotation.conjugate(), a.rotation * (b.centre - a.centre)},
                                      0.01 * kDegree, 0.01});
    }
  }

  // Frames [first, last) turned about the line of their positions.
  BlockState turned(int first, int last, double angle) const {
    BlockState state = truth;
    const Eigen::Vector3d middle = truth.frames[FrameIndex((first + last) / 2)].centre;
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitX()));
    for (int f = first; f < last; ++f) {
      Pose& pose = state.frames[FrameIndex(f)];
      pose = {pose.rotation * turn.conjugate(), middle + turn * (pose.centre - middle)};
    }
    return state;
  }

  void expect_truth(const BlockState& state, double tolerance = 1e-9) const {
    for (FrameIndex f(0); truth.frames.contains(f); ++f.value) {
      EXPECT_LT(rotation_log<double>(state.frames[f].rotation * truth.frames[f].rotation.conjugate()).norm(),
                tolerance);
      EXPECT_LT((state.frames[f].centre - truth.frames[f].centre).norm(), tolerance);
    }
  }
};

TEST(TurnedStretches, AreTurnedBack) {
  const Pass pass;
  BlockState state = pass.turned(20, 35, 48 * kDegree);
  EXPECT_EQ(turn_back_stretches(pass.block, pass.initial, state), 15);
  pass.expect_truth(state);
}

TEST(TurnedStretches, AtTheEndOfAPassToo) {
  const Pass pass;
  BlockState state = pass.turned(48, 60, -30 * kDegree);
  EXPECT_EQ(turn_back_stretches(pass.block, pass.initial, state), 12);
  pass.expect_truth(state);
}

TEST(TurnedStretches, OneBehindTheOther) {
  const Pass pass;
  BlockState state = pass.turned(20, 30, 40 * kDegree);
  const BlockState second = pass.turned(30, 36, -25 * kDegree);
  for (int f = 30; f < 36; ++f) state.frames[FrameIndex(f)] = second.frames[FrameIndex(f)];
  EXPECT_EQ(turn_back_stretches(pass.block, pass.initial, state), 16);
  pass.expect_truth(state);
}

TEST(TurnedStretches, SmallContradictionsAreLeftToTheAdjustment) {
  const Pass pass;
  BlockState state = pass.turned(20, 35, 0.5 * kDegree);
  EXPECT_EQ(turn_back_stretches(pass.block, pass.initial, state), 0);
}

TEST(TurnedStretches, AWrongRelativePoseMovesNothing) {
  Pass pass;
  RelativePose& wrong = pass.block.relative_poses[30];
  wrong.pose.rotation = rotation_exp<double>({0.5, 0, 0}) * wrong.pose.rotation;
  BlockState state = pass.truth;
  EXPECT_EQ(turn_back_stretches(pass.block, pass.initial, state), 0);
  pass.expect_truth(state, 1e-15);
}

// The initial orientation follows the wrong relative pose; the positions do not.
TEST(TurnedStretches, NorDoesOneThatMadeTheInitialOrientation) {
  Pass pass;
  RelativePose& wrong = pass.block.relative_poses[30];
  const Eigen::Quaterniond turn = rotation_exp<double>({0, 0.2, 0});
  wrong.pose.rotation = turn * wrong.pose.rotation;
  for (int f = 31; f < 60; ++f) {
    const Pose& from = pass.initial.frames[FrameIndex(f - 1)];
    const Pose& relative = pass.block.relative_poses[static_cast<std::size_t>(f - 1)].pose;
    pass.initial.frames[FrameIndex(f)] = {relative.rotation * from.rotation,
                                          from.centre + from.rotation.conjugate() * relative.centre};
  }
  BlockState state = pass.truth;
  EXPECT_EQ(turn_back_stretches(pass.block, pass.initial, state), 0);
  pass.expect_truth(state, 1e-15);
}

TEST(TurnedStretches, NothingMovesWithoutPositions) {
  Pass pass;
  for (Frame& frame : pass.block.frames) frame.position_prior.reset();
  BlockState state = pass.turned(20, 35, 48 * kDegree);
  EXPECT_EQ(turn_back_stretches(pass.block, pass.initial, state), 0);
}

TEST(TurnedStretches, FramesWithoutPoseAreLeftOut) {
  const Pass pass;
  BlockState state = pass.turned(20, 35, 48 * kDegree);
  state.oriented[FrameIndex(19)] = state.oriented[FrameIndex(35)] = 0;  // nothing ties the stretch to the rest
  EXPECT_EQ(turn_back_stretches(pass.block, pass.initial, state), 0);
}

}  // namespace
}  // namespace megablock
