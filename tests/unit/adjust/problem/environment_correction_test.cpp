#include "adjust/problem/environment_correction.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/base/error.h"

namespace megablock {
namespace {

TEST(EnvironmentCorrection, NeedsPositionsOrControlPoints) {
  Block free;
  free.frames.push_back(Frame{});
  const auto refused = [](const EnvironmentOptions& options, const Block& block) {
    try {
      check_environment(options, block);
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), testing::HasSubstr("give positions or control points, or leave the option out"));
      return true;
    }
    return false;
  };
  Block check_only = free, controlled = free, positioned = free, posed = free;
  controlled.control_points.resize(1);
  check_only.control_points.resize(1);
  check_only.control_points[0].role = PointRole::kCheck;
  positioned.frames[FrameIndex(0)].position_prior = PositionPrior{};
  posed.frames[FrameIndex(0)].given_pose = Pose{};
  for (const EnvironmentOptions& options :
       {EnvironmentOptions{true, false}, EnvironmentOptions{false, true}, EnvironmentOptions{true, true}}) {
    EXPECT_TRUE(refused(options, free));
    EXPECT_TRUE(refused(options, check_only));
    EXPECT_FALSE(refused(options, controlled));
    EXPECT_FALSE(refused(options, positioned));
    EXPECT_FALSE(refused(options, posed));
  }
  EXPECT_FALSE(refused({}, free));
}

TEST(EnvironmentCorrection, IsNotPassedOverWhereItIsNotApplied) {
  Block block;
  block.frames.push_back(Frame{});
  block.frames[FrameIndex(0)].position_prior = PositionPrior{};
  block.lines.resize(1);
  const auto message = [](auto&& call) -> std::string {
    try {
      call();
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(message([&] { check_environment({.refraction = true}, block); }),
              testing::HasSubstr("environment.refraction: measurements of lines"));
  EXPECT_EQ(message([&] { check_environment({}, block); }), "");
  EXPECT_THAT(message([&] { refuse_environment({.earth_curvature = true}, "register"); }),
              testing::HasSubstr("environment.earth_curvature: 'register' takes measurements as they are"));
  EXPECT_EQ(message([&] { refuse_environment({}, "register"); }), "");
}

}  // namespace
}  // namespace megablock
