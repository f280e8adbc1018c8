// Similarities by RANSAC: the truth among many wrong pairs.
#include "geometry/similarity/similarity_estimator.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>

#include "geometry/estimation/ransac.h"

namespace megablock {
namespace {

struct SharedPlaces {
  Similarity truth{2.5, rotation_exp<double>({1, -2, 0.5}), {1000, -2000, 300}};
  std::vector<SimilarityPair> pairs;
  SharedPlaces(std::size_t count, double wrong, std::uint64_t seed) {
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> uniform(-1, 1);
    std::normal_distribution<double> normal(0, 1);
    const auto noise = [&] {
      const double x = normal(random), y = normal(random), z = normal(random);
      return Eigen::Vector3d(x, y, z);
    };
    for (std::size_t i = 0; i < count; ++i) {
      const Eigen::Vector3d x(500 * uniform(random), 500 * uniform(random), 50 * uniform(random));
      SimilarityPair p{x + 0.1 * noise(), truth(x) + 0.2 * noise(), 0.1, 0.2};
      if (0.5 * (uniform(random) + 1) < wrong) p.to = truth(500 * noise());
      pairs.push_back(p);
    }
  }
};

double error_at_origin(const Similarity& found, const Similarity& truth) {
  return (found(Eigen::Vector3d::Zero()) - truth(Eigen::Vector3d::Zero())).norm();
}

TEST(SimilarityEstimator, FindsTheTruthAmongWrongPairs) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const SharedPlaces shared(300, 0.6, seed);
    const SimilarityEstimator estimator(shared.pairs);
    // Both with a given threshold and with one chosen a contrario.
    for (const RansacOptions& options : {RansacOptions{.threshold = 5, .seed = seed},
                                         RansacOptions{.max_threshold = 0.1 * estimator.extent(), .seed = seed}}) {
      const auto found = ransac(estimator, options);
      ASSERT_TRUE(found);
      EXPECT_NEAR(found->consensus.count, 120, 30);
      EXPECT_LT(found->threshold, 15);
      // All right pairs would give a sigma of 0.05; a chosen threshold may admit fewer of them.
      EXPECT_LT(error_at_origin(found->model, shared.truth), options.threshold > 0 ? 0.15 : 0.3);
      EXPECT_NEAR(found->model.scale / shared.truth.scale, 1, 3e-4);
    }
  }
}

TEST(SimilarityEstimator, ResidualsAreSigmas) {
  const SharedPlaces shared(3000, 0, 1);
  const auto squares = SimilarityEstimator(shared.pairs).squared_residuals(shared.truth);
  double sum = 0;
  for (std::size_t i = 0; i < 3000; ++i) sum += squares(i) / 3 / 3000;
  EXPECT_NEAR(sum, 1, 0.06);
}

TEST(SimilarityEstimator, BadInput) {
  const auto found = [](const std::vector<SimilarityPair>& pairs) {
    return ransac(SimilarityEstimator(pairs), {.threshold = 5, .max_draws = 100, .seed = 1}).has_value();
  };
  EXPECT_FALSE(found({}));
  EXPECT_FALSE(found(SharedPlaces(2, 0, 1).pairs));
  EXPECT_FALSE(found(std::vector<SimilarityPair>(20, SharedPlaces(1, 0, 1).pairs[0]))) << "one point";
  std::vector<SimilarityPair> line;
  for (int i = 0; i < 20; ++i) line.push_back({{1.0 * i, 0, 0}, {0, 2.0 * i, 0}, 0.1, 0.1});
  EXPECT_FALSE(found(line));

  SharedPlaces shared(200, 0, 2);
  for (std::size_t i = 0; i < 40; ++i) shared.pairs[5 * i].to.z() = std::numeric_limits<double>::quiet_NaN();
  const auto model = ransac(SimilarityEstimator(shared.pairs), {.threshold = 5, .seed = 1});
  ASSERT_TRUE(model);
  EXPECT_EQ(model->consensus.count, 160);
  EXPECT_LT(error_at_origin(model->model, shared.truth), 0.15);
}

}  // namespace
}  // namespace megablock
