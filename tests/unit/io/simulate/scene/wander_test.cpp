#include "io/simulate/scene/wander.h"

#include <gtest/gtest.h>

namespace megablock {
namespace {

TEST(Wander, HasTheRateOfItsPlaces) {
  Random random(7, Random::Purpose::kTrajectory);
  const Wander wander(random);
  for (const double t : {0.0, 3.7, 100.0}) {
    const Eigen::Vector3d difference = (wander.at(t + 1e-4) - wander.at(t - 1e-4)) / 2e-4;
    EXPECT_LT((difference - wander.rate(t)).norm(), 1e-7);
  }
}

TEST(Wander, HasAnRmsOfOne) {
  Random random(8, Random::Purpose::kTrajectory);
  Eigen::Vector3d squares = Eigen::Vector3d::Zero();
  constexpr int kCount = 20000;
  for (int i = 0; i < kCount; ++i) squares += Wander(random).at(7).cwiseAbs2() / kCount;
  EXPECT_LT((squares - Eigen::Vector3d::Ones()).cwiseAbs().maxCoeff(), 0.03);
}

}  // namespace
}  // namespace megablock
