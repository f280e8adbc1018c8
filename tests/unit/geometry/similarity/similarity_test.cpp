// Similarity: least squares against the truth and against neighbouring solutions, robust fits with gross errors, and
// covariances against the scatter of repeated fits.
#include "geometry/similarity/similarity.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>
#include <vector>

namespace megablock {
namespace {

struct Clouds {
  Similarity truth{2.5, rotation_exp<double>({0.3, -1.2, 0.8}), {1e5, -2e4, 300}};
  std::vector<Eigen::Vector3d> from, to;

  explicit Clouds(int count, double noise = 0, Eigen::Vector3d extent = {100, 60, 20}) {
    std::mt19937_64 random(11);
    std::uniform_real_distribution<double> place(-1, 1);
    std::normal_distribution<double> error(0, 1);
    for (int i = 0; i < count; ++i) {
      from.push_back(extent.cwiseProduct(Eigen::Vector3d(place(random), place(random), place(random))));
      to.push_back(truth(from.back()) + noise * Eigen::Vector3d(error(random), error(random), error(random)));
    }
  }
};

void expect_same(const Similarity& a, const Similarity& b, double relative, double metres) {
  EXPECT_NEAR(a.scale / b.scale, 1, relative);
  EXPECT_LT(rotation_angle(a.rotation, b.rotation), relative);
  EXPECT_LT((a.translation - b.translation).norm(), metres);
}

TEST(Similarity, RecoversAnExactTransformation) {
  for (int count : {3, 4, 50}) {
    const Clouds clouds(count);
    const auto found = fit_similarity(clouds.from, clouds.to);
    ASSERT_TRUE(found);
    expect_same(*found, clouds.truth, 1e-11, 1e-8);
    for (const auto& x : clouds.from) EXPECT_LT((found->inverse()((*found)(x)) - x).norm(), 1e-9);
  }
}

TEST(Similarity, MinimisesTheWeightedSquares) {
  const Clouds clouds(30, 3);
  std::vector<double> weights;
  for (int i = 0; i < 30; ++i) weights.push_back(0.1 + i % 5);
  const auto cost = [&](const Similarity& s) {
    double sum = 0;
    for (std::size_t i = 0; i < weights.size(); ++i)
      sum += weights[i] * (s(clouds.from[i]) - clouds.to[i]).squaredNorm();
    return sum;
  };
  const Similarity found = fit_similarity(clouds.from, clouds.to, weights).value();
  for (double step : {-1e-4, 1e-4}) {
    Similarity other = found;
    other.scale *= 1 + step;
    EXPECT_GT(cost(other), cost(found));
    for (int axis = 0; axis < 3; ++axis) {
      other = found;
      other.rotation = rotation_update(found.rotation, step * Eigen::Vector3d::Unit(axis));
      EXPECT_GT(cost(other), cost(found));
      other = found;
      other.translation[axis] += step;
      EXPECT_GT(cost(other), cost(found));
    }
  }
}

TEST(Similarity, MovesPosesWithTheirGround) {
  const Similarity s{0.5, rotation_exp<double>({0.1, 0.2, -2}), {7, 8, 9}};
  const Pose pose{rotation_exp<double>({1, -0.5, 0.2}), {3, -4, 5}};
  const Eigen::Vector3d point(10, 20, -30);
  EXPECT_LT((to_inside(s(pose), s(point)) - s.scale * to_inside(pose, point)).norm(), 1e-12);
}

TEST(Similarity, ProductIsOneBehindTheOther) {
  const Similarity first{0.5, rotation_exp<double>({0.1, 0.2, -2}), {7, 8, 9}};
  const Similarity then{3, rotation_exp<double>({-1, 0.3, 0.5}), {-70, 5, 1}};
  const Eigen::Vector3d point(10, 20, -30);
  EXPECT_LT(((then * first)(point)-then(first(point))).norm(), 1e-12);
  EXPECT_LT(((first.inverse() * first)(point)-point).norm(), 1e-12);
}

TEST(Similarity, NeverReflectsFlatOrMirroredPoints) {
  const Clouds flat(20, 0, {100, 60, 0});
  expect_same(fit_similarity(flat.from, flat.to).value(), flat.truth, 1e-10, 1e-7);
  std::vector<Eigen::Vector3d> mirrored;
  for (Eigen::Vector3d x : Clouds(20).from) mirrored.push_back(x.cwiseProduct(Eigen::Vector3d(1, 1, -1)));
  const Similarity found = fit_similarity(Clouds(20).from, mirrored).value();
  EXPECT_NEAR(found.rotation.toRotationMatrix().determinant(), 1, 1e-12);
}

TEST(Similarity, RobustFitIgnoresGrossErrors) {
  Clouds clouds(60, 0.5);
  for (std::size_t i = 0; i < 60; i += 3) clouds.to[i] += Eigen::Vector3d(1e4, 2e3 * static_cast<double>(i % 7), -500);
  const std::vector<double> sigma(60, 0.5);
  const auto found = fit_similarity_robust(clouds.from, clouds.to, sigma);
  ASSERT_TRUE(found);
  expect_same(*found, clouds.truth, 0.01, 0.5);
}

// Frames along a street: the rotation about it is undetermined, the positions are not.
TEST(Similarity, RobustFitOfPlacesOnALineIgnoresGrossErrors) {
  const Similarity truth{1.5, rotation_exp<double>({0.3, -1, 2}), {100, -50, 20}};
  std::vector<Eigen::Vector3d> from, to;
  for (int i = 0; i < 40; ++i) {
    from.emplace_back(2.0 * i, 0.5 * i, -0.1 * i);
    to.push_back(truth(from.back()));
    if (i % 3 == 0) to.back() += Eigen::Vector3d(300, 20 * (i % 7), -100);
  }
  const auto found = fit_similarity_robust(from, to, std::vector<double>(40, 0.1));
  ASSERT_TRUE(found);
  for (std::size_t i = 0; i < 40; ++i) {
    if (i % 3 != 0) {
      EXPECT_LT(((*found)(from[i]) - to[i]).norm(), 0.05) << i;
    }
  }
  EXPECT_NEAR(found->scale, truth.scale, 1e-3);
}

// With sigmas that are a hundred times too small, a solution through three points only must not win.
TEST(Similarity, RobustFitStandsSigmasThatAreTooSmall) {
  Clouds clouds(60, 0.5);
  for (std::size_t i = 0; i < 60; i += 3) clouds.to[i] += Eigen::Vector3d(1e4, 2e3 * static_cast<double>(i % 7), -500);
  const auto found = fit_similarity_robust(clouds.from, clouds.to, std::vector<double>(60, 0.005));
  ASSERT_TRUE(found);
  expect_same(*found, clouds.truth, 0.02, 1);
}

// The squared errors of many fits in the metric of the covariance: 7 on average, and chi-square distributed.
TEST(Similarity, CovarianceIsThatOfRepeatedFits) {
  const Clouds clouds(15, 0, {100, 60, 5});
  std::mt19937_64 random(12);
  std::normal_distribution<double> normal;
  std::vector<double> from_sigma, weights;
  for (int i = 0; i < 15; ++i) {
    from_sigma.push_back(0.05 + 0.02 * (i % 4));
    const double to_sigma = 2 * from_sigma.back(), s = clouds.truth.scale;
    weights.push_back(1 / (to_sigma * to_sigma + s * s * from_sigma.back() * from_sigma.back()));
  }
  constexpr int kTrials = 4000;
  double squares = 0;
  SimilarityCovariance scatter = SimilarityCovariance::Zero(), predicted = scatter;
  for (int trial = 0; trial < kTrials; ++trial) {
    auto from = clouds.from, to = clouds.to;
    for (std::size_t i = 0; i < from.size(); ++i)
      for (int k = 0; k < 3; ++k) {
        from[i][k] += from_sigma[i] * normal(random);
        to[i][k] += 2 * from_sigma[i] * normal(random);
      }
    const Similarity found = fit_similarity(from, to, weights).value();
    predicted = similarity_covariance(found, from, weights).value();
    SimilarityStep error;
    error << rotation_log<double>(clouds.truth.rotation.conjugate() * found.rotation),
        std::log(found.scale / clouds.truth.scale), found.translation - clouds.truth.translation;
    squares += error.dot(predicted.ldlt().solve(error)) / kTrials;
    scatter += error * error.transpose() / kTrials;
    EXPECT_LT((clouds.truth(from[0]) - similarity_update(found, -error)(from[0])).norm(), 1e-3);
  }
  EXPECT_NEAR(squares, 7, 4 * std::sqrt(2.0 * 7 / kTrials));
  for (int k = 0; k < 7; ++k) EXPECT_NEAR(scatter(k, k) / predicted(k, k), 1, 0.1) << k;
}

// The inverse of the normal equations at the origin, computed without centroids.
TEST(Similarity, CovarianceIsTheInverseOfTheNormalEquations) {
  const Clouds clouds(6);
  const std::vector<double> weights = {1, 2, 3, 4, 0.5, 0.25};
  SimilarityCovariance normal = SimilarityCovariance::Zero();
  for (std::size_t i = 0; i < weights.size(); ++i) {
    Eigen::Matrix<double, 3, 7> by_step;
    for (int k = 0; k < 7; ++k) {
      const SimilarityStep step = 1e-6 * SimilarityStep::Unit(k);
      by_step.col(k) = (similarity_update(clouds.truth, step)(clouds.from[i]) -
                        similarity_update(clouds.truth, -step)(clouds.from[i])) /
                       2e-6;
    }
    normal += weights[i] * by_step.transpose() * by_step;
  }
  const SimilarityCovariance covariance = similarity_covariance(clouds.truth, clouds.from, weights).value();
  const SimilarityCovariance product = normal * covariance;
  EXPECT_LT((product - SimilarityCovariance::Identity()).cwiseAbs().maxCoeff(), 1e-3);
}

TEST(Similarity, CovarianceRefusesWhatLeavesTheRotationOpen) {
  const Similarity identity;
  const std::vector<Eigen::Vector3d> line = {{0, 0, 0}, {1, 2, 3}, {2, 4, 6}, {-1, -2, -3}};
  EXPECT_FALSE(similarity_covariance(identity, line));
  EXPECT_FALSE(similarity_covariance(identity, std::vector<Eigen::Vector3d>(5, Eigen::Vector3d::Ones())));
  std::vector<Eigen::Vector3d> good = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  EXPECT_TRUE(similarity_covariance(identity, good));
  EXPECT_FALSE(similarity_covariance(identity, good, std::vector<double>(2, 1.0)));
  EXPECT_FALSE(similarity_covariance(identity, std::span(good).first(2)));
  good[1].x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(similarity_covariance(identity, good));
}

TEST(Similarity, RefusesPointsWithoutExtent) {
  const std::vector<Eigen::Vector3d> one(1, Eigen::Vector3d::Ones()), same(5, Eigen::Vector3d::Ones());
  EXPECT_FALSE(fit_similarity(one, one));
  EXPECT_FALSE(fit_similarity(same, same));
}

TEST(Similarity, RefusesWhatIsNotEquallyMany) {
  const Clouds clouds(10);
  const std::vector<double> nine(9, 1.0), ten(10, 1.0);
  const auto nine_to = std::span(clouds.to).first(9);
  EXPECT_FALSE(fit_similarity(clouds.from, nine_to));
  EXPECT_FALSE(fit_similarity(clouds.from, clouds.to, nine));
  EXPECT_FALSE(fit_similarity_robust(clouds.from, nine_to, ten));
  EXPECT_FALSE(fit_similarity_robust(clouds.from, clouds.to, nine));
  EXPECT_FALSE(fit_similarity_robust(clouds.from, clouds.to, {}));
}

TEST(Similarity, RefusesWhatIsNotANumber) {
  Clouds clouds(10);
  clouds.to[4].y() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(fit_similarity(clouds.from, clouds.to));
  EXPECT_FALSE(fit_similarity_robust(clouds.from, clouds.to, std::vector<double>(10, 1.0)));
}

}  // namespace
}  // namespace megablock
