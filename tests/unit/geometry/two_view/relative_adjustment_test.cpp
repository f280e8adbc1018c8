// The adjustment of a relative orientation: derivatives against differences, minima of the cost, and covariances
// against the errors of many simulated pairs.
#include "geometry/two_view/relative_adjustment.h"

#include <gtest/gtest.h>

#include "geometry/numbers/chi_square.h"
#include "geometry/two_view/sampson.h"
#include "tests/support/geometry/pair_scene.h"
#include "tests/support/geometry/scene_pairs.h"

namespace megablock {
namespace {

PairSceneOptions turned_scene(double noise_px, double outliers = 0) {
  PairSceneOptions options;
  options.rotation = rotation_exp<double>({0.05, -0.08, 0.3});
  options.base = {0.3, 0.05, -0.1};
  options.noise_px = noise_px;
  options.outliers = outliers;
  return options;
}

// Each derivative by differences, away from the truth, so that the part that vanishes with the residual is tested too.
TEST(RelativeAdjustment, DerivativesAreThoseOfTheResidual) {
  std::mt19937_64 random(4);
  const PairScene scene(turned_scene(2), 50, random);
  const PointPairs all = normalised_points(scene);
  for (std::size_t i = 0; i < all.size(); ++i) {
    const Eigen::Matrix<double, 5, 1> j = sampson_derivative(scene.truth, all.a[i], all.b[i]);
    for (int k = 0; k < 5; ++k) {
      constexpr double kStep = 1e-6;
      double residual[2];
      for (const int sign : {-1, 1}) {
        Eigen::Matrix<double, 5, 1> step = Eigen::Matrix<double, 5, 1>::Zero();
        step(k) = sign * kStep;
        const RelativeOrientation moved{
            rotation_update(scene.truth.rotation, step.head<3>()),
            (scene.truth.base + axes_across(scene.truth.base) * step.tail<2>()).normalized()};
        residual[sign > 0] = sampson_residual(essential_from(moved), all.a[i], all.b[i]);
      }
      EXPECT_NEAR(j(k), (residual[1] - residual[0]) / (2 * kStep), 1e-8 * (1 + j.norm())) << i << ' ' << k;
    }
  }
}

TEST(RelativeAdjustment, ReachesTheTruthWithoutNoiseFromNearby) {
  std::mt19937_64 random(1);
  const PairScene scene(turned_scene(0), 800, random);
  const RelativeOrientation start{rotation_update(scene.truth.rotation, Eigen::Vector3d(1e-4, -1e-4, 2e-4)),
                                  (scene.truth.base + Eigen::Vector3d(0.001, 0.002, -0.001)).normalized()};
  const RelativeOrientation found = adjust_orientation(start, normalised_points(scene), {0.2 / kSceneFocalPx});
  EXPECT_LT(rotation_error_deg(found, scene.truth), 1e-7);
  EXPECT_LT(base_error_deg(found, scene.truth), 1e-6);
}

TEST(RelativeAdjustment, EndsInAMinimumOfTheSampsonResiduals) {
  std::mt19937_64 random(2);
  const PairScene scene(turned_scene(0.5), 800, random);
  const PointPairs points = normalised_points(scene);
  const double scale = 1.5 / kSceneFocalPx;
  const auto cost = [&](const RelativeOrientation& o) {
    double sum = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const double r = sampson_residual(essential_from(o), points.a[i], points.b[i]);
      sum += r * r / (1 + r * r / (scale * scale));
    }
    return sum;
  };
  const RelativeOrientation found = adjust_orientation(scene.truth, points, {scale});
  const double least = cost(found);
  EXPECT_LE(least, cost(scene.truth));
  for (int axis = 0; axis < 3; ++axis)
    for (const double step : {-1e-5, 1e-5}) {
      RelativeOrientation turned = found, moved = found;
      turned.rotation = rotation_update(found.rotation, step * Eigen::Vector3d::Unit(axis));
      moved.base = (found.base + 10 * step * Eigen::Vector3d::Unit(axis)).normalized();
      EXPECT_GE(cost(turned), least);
      EXPECT_GE(cost(moved), least * (1 - 1e-12));
    }
}

Eigen::Matrix<double, 5, 1> error_of(const RelativeOrientation& found, const RelativeOrientation& truth) {
  Eigen::Matrix<double, 5, 1> e;
  e << rotation_log<double>((found.rotation.conjugate() * truth.rotation).normalized()),
      axes_across(found.base).transpose() * (truth.base - found.base);
  return e;
}

TEST(RelativeAdjustment, CovarianceIsThatOfTheErrors) {
  for (const Eigen::Vector3d& base : {Eigen::Vector3d(0.3, 0, 0), Eigen::Vector3d(0, 0, 0.3)}) {
    std::mt19937_64 random(3);
    constexpr int kTrials = 200;
    double sum = 0;
    for (int trial = 0; trial < kTrials; ++trial) {
      PairSceneOptions options = turned_scene(0.5);
      options.base = base;
      const PairScene scene(options, 200, random);
      const PointPairs points = normalised_points(scene);
      const std::vector<std::uint8_t> all(points.size(), 1);
      const RelativeOrientation found = adjust_orientation(scene.truth, points, {1});
      const OrientationPrecision precision = precision_of(found, points, all, 1, 0);
      EXPECT_NEAR(precision.sigma * kSceneFocalPx, 0.5, 0.12);
      const auto e = error_of(found, scene.truth);
      sum += e.dot(precision.covariance.inverse() * e);
    }
    // A sum of chi-square variables with five degrees of freedom each, within 99.9 %.
    EXPECT_GT(chi_square_exceeds(sum, 5 * kTrials), 5e-4) << sum / (5 * kTrials);
    EXPECT_LT(chi_square_exceeds(sum, 5 * kTrials), 1 - 5e-4) << sum / (5 * kTrials);
  }
}

TEST(RelativeAdjustment, WithoutABaseItIsOpenAndTheRotationIsNot) {
  std::mt19937_64 random(5);
  PairSceneOptions options = turned_scene(0.5);
  options.base.setZero();
  const PairScene scene(options, 500, random);
  const PointPairs points = normalised_points(scene);
  const RelativeOrientation found = adjust_orientation(scene.truth, points, {3 / kSceneFocalPx});
  const OrientationPrecision precision =
      precision_of(found, points, std::vector<std::uint8_t>(points.size(), 1), 3 / kSceneFocalPx, 1e-6);
  EXPECT_GT(precision.base_sigma(), 10 * std::numbers::pi / 180);
  EXPECT_LT(precision.rotation_sigma(), 0.2 * std::numbers::pi / 180);
}

TEST(RelativeAdjustment, WhatCannotBeKnownIsOpen) {
  const PointPairs one_point{std::vector<Eigen::Vector2d>(20, {0.1, 0.2}),
                             std::vector<Eigen::Vector2d>(20, {0.1, 0.1})};
  const std::vector<std::uint8_t> all(20, 1);
  std::vector<std::uint8_t> few(20, 0);
  std::fill_n(few.begin(), 5, std::uint8_t{1});
  const RelativeOrientation some;
  EXPECT_NEAR(precision_of(some, one_point, all, 1e-2, 1e-3).base_sigma(), std::numbers::pi, 1e-6);
  EXPECT_NEAR(precision_of(some, one_point, few, 1e-2, 1e-3).rotation_sigma(), std::numbers::pi, 1e-6);
  PointPairs not_numbers = one_point;
  not_numbers.a.assign(20, Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN()));
  EXPECT_NEAR(precision_of(some, not_numbers, all, 1e-2, 1e-3).base_sigma(), std::numbers::pi, 1e-6);
  EXPECT_TRUE(adjust_orientation(some, not_numbers, {}).rotation.coeffs().allFinite());
}

}  // namespace
}  // namespace megablock
