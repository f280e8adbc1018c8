#include "adjust/tile/sigma_scales.h"

#include <gtest/gtest.h>

namespace megablock {
namespace {

using enum ObservationKind;

TEST(SigmaScales, FollowTheResidualsButNotBelowTheStatedSigmas) {
  ObservationTable table;
  table[kPositionHorizontal] = {200, 900, 100};
  table[kPositionHeight] = {100, 1, 100};
  table[kAttitude] = {60, 900, 20};  // too few
  table[kTieImage] = {2000, 9000, 1000};
  SigmaScales now;
  now[kPositionHeight] = 2;
  const SigmaScales scales = next_sigma_scales(now, table);
  EXPECT_DOUBLE_EQ(scales[kPositionHorizontal], 3);
  EXPECT_DOUBLE_EQ(scales[kPositionHeight], 0.5);
  EXPECT_DOUBLE_EQ(scales[kAttitude], 1);
  EXPECT_DOUBLE_EQ(scales[kTieImage], 1);
  EXPECT_TRUE(scales.matter());
  EXPECT_FALSE(SigmaScales().matter());
}

TEST(SigmaScales, ScaleTheTermsOfTheProblem) {
  TileProblem problem;
  problem.positions.push_back({LocalFrame(0), PositionPrior{{0, 0, 0}, {1, 2, 3}, {0, 0, 0}}});
  problem.attitudes.push_back({LocalFrame(0), AttitudePrior{Eigen::Quaterniond::Identity(), {1, 2, 3}}});
  problem.relatives.push_back({LocalFrame(0), LocalFrame(1), Pose(), 0.1, 0.2});
  SigmaScales scales;
  scales[kPositionHorizontal] = 2;
  scales[kPositionHeight] = 5;
  scales[kAttitude] = 3;
  scales[kRelativeRotation] = 4;
  scales[kRelativePosition] = 6;
  scale_sigmas(problem, scales);
  EXPECT_EQ(problem.positions[0].prior.sigma, Eigen::Vector3d(2, 4, 15));
  EXPECT_EQ(problem.attitudes[0].prior.sigma_rad, Eigen::Vector3d(3, 6, 9));
  EXPECT_DOUBLE_EQ(problem.relatives[0].rotation_sigma_rad, 0.4);
  EXPECT_DOUBLE_EQ(problem.relatives[0].position_sigma_m, 1.2);
}

}  // namespace
}  // namespace megablock
