// The RANSAC engine with an estimator of a linear model: numbers of draws, thresholds and false alarms against closed
// formulas, and models among outliers.
#include "geometry/estimation/ransac.h"

#include <gtest/gtest.h>

#include <stdexcept>

#include "geometry/numbers/binomial.h"
#include "tests/support/geometry/linear_model.h"

namespace megablock {
namespace {

TEST(Ransac, DrawsNeeded) {
  EXPECT_EQ(draws_needed(5, 0.5, 0.99), 146);
  EXPECT_EQ(draws_needed(2, 1, 0.99), 1);
  EXPECT_TRUE(std::isinf(draws_needed(2, 0, 0.99)));
  // A power of the share below the smallest double must not lead to a division by zero.
  EXPECT_GT(draws_needed(8, 1e-3, 0.99), 1e23);
}

TEST(Ransac, ThresholdHoldsTheShareOfRightResiduals) {
  EXPECT_NEAR(threshold_of_sigma(2, 1, 0.95), 2 * 1.959964, 1e-5);
  EXPECT_NEAR(threshold_of_sigma(1, 2, 0.99), std::sqrt(9.21034), 1e-5);
}

TEST(Ransac, FalseAlarmsAreThoseOfTheLargestBinomialTerm) {
  const FalseAlarms alarms(100, 3);
  // C(100, 40) C(40, 3) 97 p^37, by logarithms.
  const double expected = std::log10(1.3746234146e28) + std::log10(9880.0) + std::log10(97.0) + 37 * std::log10(0.05);
  EXPECT_NEAR(alarms.log10_nfa(40, 0.05), expected, 1e-6);
  EXPECT_GT(alarms.log10_nfa(40, 0.05), log10_binomial_tail(97, 37, 0.05)) << "many models are tried";
  EXPECT_TRUE(std::isinf(alarms.log10_nfa(3, 0.05)));
}

TEST(Ransac, FindsTheModelAmongWrongObservations) {
  for (const double outliers : {0.0, 0.3, 0.6}) {
    const LinearModelScene<3> scene(400, outliers, 0.01, 7);
    const auto found = ransac(LinearModelEstimator<3>(scene), {.threshold = 0.03, .max_draws = 2000, .seed = 1});
    ASSERT_TRUE(found);
    EXPECT_LT((found->model - scene.truth).norm(), 0.01);
    EXPECT_NEAR(found->consensus.count, 400 * (1 - outliers), 400 * (0.02 + 0.05 * outliers));
    int counted = 0;
    for (const std::uint8_t i : found->consensus.inlier) counted += i;
    EXPECT_EQ(counted, found->consensus.count);
    EXPECT_LT(found->draws, 2 * draws_needed(3, 1 - outliers, 0.99) + 2);
  }
}

TEST(Ransac, TheSeedDecidesAndNothingElse) {
  const LinearModelScene<3> scene(300, 0.6, 0.01, 8);
  const LinearModelEstimator<3> estimator(scene);
  const auto one = ransac(estimator, {.threshold = 0.03, .seed = 5}),
             same = ransac(estimator, {.threshold = 0.03, .seed = 5});
  EXPECT_EQ(one->model, same->model);
  EXPECT_EQ(one->draws, same->draws);
  EXPECT_EQ(one->consensus.inlier, same->consensus.inlier);
}

TEST(Ransac, ThresholdIsChosenAContrario) {
  for (const double noise : {0.001, 0.01, 0.05}) {
    const LinearModelScene<3> scene(400, 0.5, noise, 9);
    const auto found = ransac(LinearModelEstimator<3>(scene), {.max_threshold = 3, .seed = 2});
    ASSERT_TRUE(found);
    EXPECT_LT(found->log10_nfa, -50);
    EXPECT_GT(found->threshold, noise);
    EXPECT_LT(found->threshold, 5 * noise);
    EXPECT_LT((found->model - scene.truth).norm(), noise);
  }
  // From noise alone at most one in a thousand is accepted as a model, as 10^log10_nfa says.
  int accepted = 0;
  for (std::uint64_t seed = 0; seed < 30; ++seed) {
    const LinearModelScene<3> wrong(60, 1, 0.01, seed);
    const auto found = ransac(LinearModelEstimator<3>(wrong), {.max_threshold = 3, .max_draws = 300, .seed = seed});
    accepted += found && found->log10_nfa < -3;
  }
  EXPECT_EQ(accepted, 0);
}

TEST(Ransac, StartsAreBetterThanNothing) {
  const LinearModelScene<3> scene(300, 0.5, 0.01, 10);
  const LinearModelEstimator<3> estimator(scene);
  const std::array start = {scene.truth};
  const auto found =
      ransac(estimator, {.threshold = 0.03, .max_draws = 1, .seed = 3}, std::span<const Eigen::Vector3d>(start));
  ASSERT_TRUE(found);
  EXPECT_GE(found->consensus.score, consensus_of(estimator, scene.truth, 0.03).score);
}

// Ten observations have 120 samples of three.
TEST(Ransac, FewSamplesAreAllTaken) {
  EXPECT_EQ(number_of_samples(10, 3), 120);
  EXPECT_EQ(number_of_samples(3, 3), 1);
  EXPECT_EQ(number_of_samples(2, 3), 0);
  const LinearModelScene<3> scene(10, 0.5, 0.01, 4);
  const LinearModelEstimator<3> estimator(scene);
  const auto all = ransac(estimator, {.threshold = 0.05, .enumerate = 120});
  ASSERT_TRUE(all);
  EXPECT_EQ(all->draws, 120);
  EXPECT_LT((all->model - scene.truth).norm(), 0.05);
  EXPECT_EQ(ransac(estimator, {.threshold = 0.05, .enumerate = 120, .seed = 9})->model, all->model);
  EXPECT_NE(ransac(estimator, {.threshold = 0.05, .enumerate = 119})->draws, 120);
}

TEST(Ransac, KeepsTheBestInOrder) {
  const LinearModelScene<2> scene(40, 0.3, 0.05, 5);
  const LinearModelEstimator<2> estimator(scene);
  const RansacOptions options{.threshold = 0.1, .min_draws = 200, .keep = 8, .seed = 3};
  const auto found = ransac(estimator, options);
  ASSERT_TRUE(found);
  EXPECT_GE(found->draws, 200);
  ASSERT_EQ(found->others.size(), 7u);
  double before = found->consensus.score;
  for (const auto& other : found->others) {
    const double score = consensus_of(estimator, other, 0.1).score;
    EXPECT_LE(score, before);
    before = score;
  }
}

TEST(Ransac, BadInput) {
  const LinearModelScene<3> two(2, 0, 0, 1), three(3, 0, 0, 1);
  EXPECT_FALSE(ransac(LinearModelEstimator<3>(two), {.threshold = 1}));
  EXPECT_TRUE(ransac(LinearModelEstimator<3>(three), {.threshold = 1}));
  LinearModelScene<3> bad(100, 0.2, 0.01, 11);
  for (std::size_t i = 0; i < 30; ++i) bad.y[i] = std::numeric_limits<double>::quiet_NaN();
  const auto found = ransac(LinearModelEstimator<3>(bad), {.threshold = 0.03, .seed = 1});
  ASSERT_TRUE(found);
  EXPECT_LT((found->model - bad.truth).norm(), 0.02);
  for (std::size_t i = 0; i < 30; ++i) EXPECT_FALSE(found->consensus.inlier[i]);
  for (double& y : bad.y) y = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(ransac(LinearModelEstimator<3>(bad), {.threshold = 0.03, .max_draws = 50}));
  EXPECT_FALSE(ransac(LinearModelEstimator<3>(bad), {.max_threshold = 1, .max_draws = 50}));
  // One observation many times: no sample gives a model.
  LinearModelScene<3> same(100, 0, 0, 12);
  for (std::size_t i = 1; i < 100; ++i) same.x[i] = same.x[0], same.y[i] = same.y[0];
  EXPECT_FALSE(ransac(LinearModelEstimator<3>(same), {.threshold = 0.03, .max_draws = 50}));

  const LinearModelEstimator<3> estimator(three);
  EXPECT_THROW(ransac(estimator, {}), std::invalid_argument);
  EXPECT_THROW(ransac(estimator, {.threshold = std::numeric_limits<double>::quiet_NaN()}), std::invalid_argument);
  EXPECT_THROW(ransac(estimator, {.threshold = 1, .confidence = 1}), std::invalid_argument);
  EXPECT_THROW(ransac(estimator, {.threshold = 1, .inlier_share = 2}), std::invalid_argument);
  EXPECT_THROW(ransac(estimator, {.threshold = 1, .max_draws = 0}), std::invalid_argument);
}

}  // namespace
}  // namespace megablock
