// Projection and its inverse for the Brown model, against formulas written out, round trips and finite differences.
#include "geometry/camera/camera.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace megablock {
namespace {

constexpr Intrinsics kBrown = {1450, 955, 644, -0.12, 0.05, -0.01, 1e-3, -7e-4};

TEST(Camera, PinholeProjection) {
  const Intrinsics pinhole = {1000, 500, 400, 0, 0, 0, 0, 0};
  EXPECT_TRUE(project(pinhole, {0.2, -0.1, 2}).isApprox(Eigen::Vector2d(600, 350)));
}

TEST(Camera, DistortionTermsOneByOne) {
  const double x = 0.3, y = -0.2, r2 = x * x + y * y;
  const auto distorted = [&](IntrinsicParameter p, double value) {
    Intrinsics k = {1, 0, 0, 0, 0, 0, 0, 0};
    k[p] = value;
    return Eigen::Vector2d(project(k, {x, y, 1}) - Eigen::Vector2d(x, y));
  };
  EXPECT_TRUE(distorted(kRadial1, 0.1).isApprox(0.1 * r2 * Eigen::Vector2d(x, y), 1e-12));
  EXPECT_TRUE(distorted(kRadial2, 0.1).isApprox(0.1 * r2 * r2 * Eigen::Vector2d(x, y), 1e-12));
  EXPECT_TRUE(distorted(kRadial3, 0.1).isApprox(0.1 * r2 * r2 * r2 * Eigen::Vector2d(x, y), 1e-12));
  EXPECT_TRUE(distorted(kDecentring1, 0.1).isApprox(Eigen::Vector2d(0.2 * x * y, 0.1 * (r2 + 2 * y * y)), 1e-12));
  EXPECT_TRUE(distorted(kDecentring2, 0.1).isApprox(Eigen::Vector2d(0.1 * (r2 + 2 * x * x), 0.2 * x * y), 1e-12));
}

TEST(Camera, JacobiansMatchFiniteDifferences) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> place(-0.6, 0.6);
  for (int trial = 0; trial < 20; ++trial) {
    const Eigen::Vector3d point = 7 * Eigen::Vector3d(place(random), place(random), 1);
    const ProjectionJacobian analytic = project_with_jacobian(kBrown, point);
    EXPECT_TRUE(analytic.pixel.isApprox(project(kBrown, point), 1e-15));
    for (int i = 0; i < 3; ++i) {
      constexpr double kStep = 1e-5;
      const Eigen::Vector3d d = kStep * Eigen::Vector3d::Unit(i);
      const Eigen::Vector2d numeric = (project(kBrown, point + d) - project(kBrown, point - d)) / (2 * kStep);
      EXPECT_LT((analytic.by_point.col(i) - numeric).norm(), 1e-6) << "coordinate " << i;
    }
    for (int k = 0; k < kBrown.size(); ++k) {
      const double step = k <= kPrincipalY ? 1e-3 : 1e-6;
      Intrinsics low = kBrown, high = kBrown;
      low[k] -= step;
      high[k] += step;
      const Eigen::Vector2d numeric = (project(high, point) - project(low, point)) / (2 * step);
      EXPECT_LT((analytic.by_intrinsics.col(static_cast<Eigen::Index>(k)) - numeric).norm(), 1e-5)
          << parameter_name(kBrown.model(), k);
    }
  }
}

TEST(Camera, UnprojectInvertsProject) {
  for (double x = -0.6; x <= 0.6; x += 0.1)
    for (double y = -0.45; y <= 0.45; y += 0.1) {
      const auto back = unproject(kBrown, project(kBrown, {x, y, 1}));
      ASSERT_TRUE(back) << x << " " << y;
      EXPECT_LT((*back - Eigen::Vector2d(x, y)).norm(), 1e-12);
      const auto ray = viewing_ray(kBrown, project(kBrown, {x, y, 1}));
      EXPECT_LT((*ray - Eigen::Vector3d(x, y, 1).normalized()).norm(), 1e-12);
    }
}

TEST(Camera, UnprojectRefusesBeyondTheTurningPoint) {
  // x (1 - x^2 / 3) grows up to x = 1, where it reaches 2/3. No point has a larger distorted radius.
  const Intrinsics barrel = {1000, 0, 0, -1.0 / 3, 0, 0, 0, 0};
  EXPECT_TRUE(unproject(barrel, {600, 0}));
  EXPECT_FALSE(unproject(barrel, {700, 0}));
  EXPECT_FALSE(viewing_ray(barrel, {0, -900}));
  EXPECT_FALSE(unproject(barrel, {std::nan(""), 0}));
}

}  // namespace
}  // namespace megablock
