#include "geometry/rotation_fit.h"

#include <gtest/gtest.h>

#include <vector>

#include "geometry/rotation.h"

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
