// Residuals of positions in one heap and in two.
#include "io/evaluation/position_groups.h"

#include <gtest/gtest.h>

#include <random>

namespace megablock {
namespace {

using report::PositionResidual;

struct Residuals {
  BlockResult result;
  std::vector<PositionResidual> rows;

  // `count` positions off by normal errors of `scatter` m.
  Residuals(std::int64_t count, double scatter, std::uint64_t seed = 1) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> error(0, scatter);
    for (std::int64_t i = 0; i < count; ++i) {
      Frame frame;
      frame.name = "f" + std::to_string(i);
      frame.position_prior = PositionPrior{};
      frame.position_prior->sigma = {3, 3, 6};
      result.block.frames.push_back(frame);
      rows.push_back({FrameIndex(i), Eigen::Vector3d(error(random), error(random), error(random)),
                      Eigen::Vector3d(11, 11, 22)});  // those of the adjustment
    }
  }
  std::string text() const { return position_groups_text(result, rows); }
};

TEST(PositionGroups, OfTwoFlightsAreNamed) {
  Residuals block(18, 0.6);
  for (std::size_t i = 9; i < 18; ++i) block.rows[i].difference.z() -= 30;  // the observed heights are too high
  EXPECT_EQ(block.text().substr(0, 22), "9 of 18 positions lie ") << block.text();
  EXPECT_NEAR(std::stod(block.text().substr(22)), 30, 1);
  EXPECT_NE(block.text().find("above the other 9: f9, f10, f11, f12, f13 and 4 more; "), std::string::npos);
}

TEST(PositionGroups, AreFoundAlongEveryAxisAndForFewOfMany) {
  Residuals block(200, 2);
  for (const std::size_t i : {3u, 50u, 51u, 120u}) block.rows[i].difference.x() -= 25;
  EXPECT_EQ(block.text().substr(0, 22), "4 of 200 positions lie");
  EXPECT_NE(block.text().find(" m east of the other 196: f3, f50, f51, f120;"), std::string::npos) << block.text();
}

TEST(PositionGroups, AreNotSeenInOneHeap) {
  for (std::uint64_t seed = 1; seed <= 500; ++seed) {
    EXPECT_EQ(Residuals(8, 30, seed).text(), "") << seed;  // five times what is stated
    EXPECT_EQ(Residuals(100, 30, seed).text(), "") << seed;
  }
  Residuals even(60, 0);
  for (std::size_t i = 0; i < 60; ++i) even.rows[i].difference.z() = 2.0 * static_cast<double>(i);
  EXPECT_EQ(even.text(), "");
}

TEST(PositionGroups, AreNoOutliersAndNothingWithinTheSigmas) {
  Residuals two(18, 0.6);
  for (const std::size_t i : {4u, 11u}) two.rows[i].difference.z() += 180;
  EXPECT_EQ(two.text(), "");
  Residuals near(18, 0.3);
  for (std::size_t i = 9; i < 18; ++i) near.rows[i].difference.z() -= 15;  // of a stated 6 m
  EXPECT_EQ(near.text(), "");
  EXPECT_EQ(Residuals(4, 1).text(), "");
  EXPECT_EQ(Residuals(0, 1).text(), "");
}

}  // namespace
}  // namespace megablock
