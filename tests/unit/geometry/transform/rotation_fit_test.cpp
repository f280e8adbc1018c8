// Rotations between directions: exact, weighted and with outliers.
#include "geometry/transform/rotation_fit.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "geometry/transform/rotation.h"

namespace megablock {
namespace {

struct Directions {
  Eigen::Quaterniond rotation{Eigen::Quaterniond(0.3, -0.4, 0.7, 0.5).normalized()};
  std::vector<Eigen::Vector3d> from, to;
  Directions() {
    std::srand(7);
    for (int i = 0; i < 60; ++i) {
      from.push_back(Eigen::Vector3d::Random().normalized());
      to.push_back(rotation * from.back());
    }
  }
};

TEST(RotationFit, FindsTheRotationOfExactDirections) {
  const Directions d;
  EXPECT_LT(rotation_angle(fit_rotation(d.from, d.to), d.rotation), 1e-12);
  EXPECT_LT(rotation_angle(fit_rotation_robust(d.from, d.to), d.rotation), 1e-12);
}

TEST(RotationFit, BetweenTwoDirectionsIsTheLeastOne) {
  const Eigen::Vector3d from(0.3, -2, 1), axis = from.unitOrthogonal();
  for (const double angle :
       {0.0, 1e-9, 0.5, 2.0, 3.1, std::numbers::pi - 1e-4, std::numbers::pi - 1e-7, std::numbers::pi}) {
    const Eigen::Vector3d to = 7 * (rotation_exp<double>(angle * axis) * from);
    const Eigen::Quaterniond rotation = rotation_between(from, to);
    const bool opposite = angle > std::numbers::pi - 1e-6;
    EXPECT_LT((rotation * from.normalized() - to.normalized()).norm(),
              opposite ? 1e-14 : 1e-14 + 1e-15 / (1 + std::cos(angle)))
        << angle;
    EXPECT_NEAR(rotation_angle(rotation, Eigen::Quaterniond::Identity()), opposite ? std::numbers::pi : angle, 1e-9)
        << angle;
  }
}

TEST(RotationFit, WeightsOfZeroLeavePairsOut) {
  Directions d;
  std::vector<double> weight(d.from.size(), 1);
  d.to[3] = -d.to[3];
  weight[3] = 0;
  EXPECT_LT(rotation_angle(fit_rotation(d.from, d.to, weight), d.rotation), 1e-12);
}

TEST(RotationFit, NotANumberGivesNotANumber) {
  Directions d;
  d.to[3].z() = std::nan("");
  EXPECT_TRUE(fit_rotation(d.from, d.to).coeffs().hasNaN());
  EXPECT_TRUE(fit_rotation_robust(d.from, d.to).coeffs().hasNaN());
}

TEST(RotationFit, NotEquallyManyGiveNotANumber) {
  const Directions d;
  const auto fewer = std::span(d.to).first(59);
  EXPECT_TRUE(fit_rotation(d.from, fewer).coeffs().hasNaN());
  EXPECT_TRUE(fit_rotation_robust(d.from, fewer).coeffs().hasNaN());
  EXPECT_TRUE(fit_rotation(d.from, d.to, std::vector<double>(59, 1.0)).coeffs().hasNaN());
}

TEST(RotationFit, RobustFitWithstandsAThirdOfWrongPairs) {
  Directions d;
  for (std::size_t i = 0; i < d.to.size(); ++i) {
    d.to[i] = (d.to[i] + 1e-4 * Eigen::Vector3d::Random()).normalized();
    if (i % 3 == 0) d.to[i] = Eigen::Vector3d::Random().normalized();
  }
  EXPECT_LT(rotation_angle(fit_rotation_robust(d.from, d.to), d.rotation), 1e-4);
  EXPECT_GT(rotation_angle(fit_rotation(d.from, d.to), d.rotation), 1e-2);
}

}  // namespace
}  // namespace megablock
