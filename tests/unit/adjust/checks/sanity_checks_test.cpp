#include "adjust/checks/sanity_checks.h"

#include <gtest/gtest.h>

#include <limits>

namespace megablock {
namespace {

TEST(SanityChecks, PointsThatAreNotFiniteAreLeftOut) {
  std::vector<Eigen::Vector3d> known, all;
  constexpr double kInfinite = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 200; ++i) {
    known.emplace_back(i % 20, i / 20, (i % 4 == 0 ? 5 : 0) + 0.01 * (i % 7));  // NOLINT: a row of twenty
    all.push_back(known.back());
    if (i % 3 == 0) all.emplace_back(0, 0, std::numeric_limits<double>::quiet_NaN());
    if (i % 5 == 0) all.emplace_back(1, -kInfinite, kInfinite);
  }
  const LevelCheck expected = check_one_level(known), found = check_one_level(all);
  EXPECT_FALSE(expected.sound());
  EXPECT_EQ(found.separation, expected.separation);
  EXPECT_EQ(found.step, expected.step);
  EXPECT_EQ(found.smaller_share, expected.smaller_share);

  const std::vector<Eigen::Vector3d> none(20, Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()));
  EXPECT_EQ(check_one_level(none).separation, 0);
}

TEST(SanityChecks, CentresThatAreNotFiniteMakeNoStrip) {
  std::vector<Eigen::Vector3d> strip;
  for (int i = 0; i < 6; ++i) strip.emplace_back(100.0 * i, 50.0 * i, 500);
  ASSERT_TRUE(check_strip(strip).sound());
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()})
    for (std::size_t i = 0; i < strip.size(); ++i)
      for (int axis = 0; axis < 3; ++axis) {
        auto centres = strip;
        centres[i][axis] = bad;
        const StripCheck check = check_strip(centres);
        EXPECT_FALSE(check.sound());
        EXPECT_GT(check.off_line, 1e9) << "no number, of which a report could make nothing";
        EXPECT_GT(check.uneven, 1e9);
      }
}

}  // namespace
}  // namespace megablock
