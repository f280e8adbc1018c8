#include "io/evaluation/used_sigmas.h"

#include <gtest/gtest.h>

namespace megablock {
namespace {

TEST(UsedSigmas, AreTheStatedOnesTimesTheFactorsOfTheResult) {
  BlockResult result;
  ControlPoint point;
  point.sigma = {0.01, 0.02, 0.03};
  PositionPrior prior;
  prior.sigma = {1, 2, 4};
  EXPECT_EQ(used_sigma(result, point), point.sigma);
  EXPECT_EQ(used_sigma(result, prior), prior.sigma);
  result.observation_table[ObservationKind::kControlHorizontal].scale = 10;
  result.observation_table[ObservationKind::kPositionHeight].scale = 5;
  EXPECT_TRUE(used_sigma(result, point).isApprox(Eigen::Vector3d(0.1, 0.2, 0.03)));
  EXPECT_TRUE(used_sigma(result, prior).isApprox(Eigen::Vector3d(1, 2, 20)));
  result.position_scales = {{RigIndex(4), 3, 1}};
  EXPECT_TRUE(used_sigma(result, prior).isApprox(Eigen::Vector3d(1, 2, 20)));
  prior.group = RigIndex(4);
  EXPECT_TRUE(used_sigma(result, prior).isApprox(Eigen::Vector3d(3, 6, 4)));
}

}  // namespace
}  // namespace megablock
