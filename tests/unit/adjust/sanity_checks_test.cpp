#include "adjust/sanity_checks.h"

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

}  // namespace
}  // namespace megablock
