#include "io/evaluation/remarks/upward_remark.h"

#include <gmock/gmock.h>

#include <numbers>

#include "tests/support/io/made_up_result.h"

namespace megablock {
namespace {

// An aerial block without attitudes, whose control takes no part: its positions lie in a plane.
BlockResult level_block() {
  BlockResult result = made_up_result(small_block());
  for (Frame& frame : result.block.frames) {
    frame.attitude_prior.reset();
    frame.given_pose.reset();
  }
  result.block.verticals.clear();
  result.block.control_points.clear();
  result.control.clear();
  return result;
}

// Half a turn about the east axis.
void turn_over(BlockResult& result, std::int64_t frames) {
  const Eigen::Quaterniond half(Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitX()));
  for (FrameIndex f(0); f.value < frames; ++f.value)
    result.state.frames[f].rotation = result.state.frames[f].rotation * half;
}

TEST(UpwardRemark, ABlockThatLooksDownGetsNone) {
  EXPECT_EQ(upward_text(level_block()), "");
  EXPECT_EQ(upward_text(BlockResult{}), "");
}

TEST(UpwardRemark, IsMadeWhereMoreThanTwoThirdsLookUp) {
  BlockResult result = level_block();
  turn_over(result, std::ssize(result.block.frames));
  EXPECT_THAT(upward_text(result),
              testing::MatchesRegex("([0-9]+) of [0-9]+ cameras look upward: the block may be upside down, .*"));
  BlockResult half = level_block();
  turn_over(half, std::ssize(half.block.frames) / 2);
  EXPECT_EQ(upward_text(half), "");
}

TEST(UpwardRemark, IsNotMadeWhereObservationsTellTheSide) {
  BlockResult upside_down = level_block();
  turn_over(upside_down, std::ssize(upside_down.block.frames));
  BlockResult attitudes = upside_down;
  attitudes.block.frames[FrameIndex(0)].attitude_prior = AttitudePrior{};
  EXPECT_EQ(upward_text(attitudes), "");
  BlockResult relief = upside_down;
  for (FrameIndex f(0); relief.block.frames.contains(f); ++f.value)
    if (auto& prior = relief.block.frames[f].position_prior) prior->position.z() += f.value % 2 ? 300 : 0;
  EXPECT_EQ(upward_text(relief), "");
  BlockResult free = upside_down;
  for (Frame& frame : free.block.frames) frame.position_prior.reset();
  EXPECT_EQ(upward_text(free), "");
}

}  // namespace
}  // namespace megablock
