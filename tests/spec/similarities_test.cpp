// Acceptance tests of direct orientation (Kalantari 2009) that concern similarities (M50). Protocol X20: 1000 points
// in a cube of side 2000, noise in both systems; rotations about X, Y, Z of 0 to 80 deg, translations of 0 to 6000
// along each axis, scales of 0.5 to 2, one at a time: 27 configurations.
#include <gtest/gtest.h>

#include "geometry/estimation/ransac.h"
#include "geometry/numbers/median.h"
#include "geometry/similarity/minimal_similarity.h"
#include "geometry/similarity/similarity_estimator.h"
#include "reached.h"
#include "tests/support/geometry/pair_scene.h"

namespace megablock {
namespace {

Similarity of_angles(double x_deg, double y_deg, double z_deg, double scale, const Eigen::Vector3d& translation) {
  const auto turn = [](double angle_deg, const Eigen::Vector3d& axis) {
    return Eigen::Quaterniond(Eigen::AngleAxisd(angle_deg * std::numbers::pi / 180, axis));
  };
  return {scale,
          turn(x_deg, Eigen::Vector3d::UnitX()) * turn(y_deg, Eigen::Vector3d::UnitY()) *
              turn(z_deg, Eigen::Vector3d::UnitZ()),
          translation};
}

std::vector<Similarity> configurations() {
  const Eigen::Vector3d usual(2000, 1000, 500);
  std::vector<Similarity> all = {of_angles(0, 0, 0, 1.5, usual)};
  for (int axis = 0; axis < 3; ++axis)
    for (const double angle : {20.0, 40.0, 60.0, 80.0})
      all.push_back(of_angles(axis == 0 ? angle : 0, axis == 1 ? angle : 0, axis == 2 ? angle : 0, 1.5, usual));
  all.push_back(of_angles(40, 20, 30, 2, Eigen::Vector3d::Zero()));
  for (int axis = 0; axis < 3; ++axis)
    for (const double shift : {2000.0, 4000.0, 6000.0})
      all.push_back(of_angles(40, 20, 30, 2, shift * Eigen::Vector3d::Unit(axis)));
  for (const double scale : {0.5, 1.0, 1.5, 2.0}) all.push_back(of_angles(40, 20, 30, scale, usual));
  return all;
}

struct DisturbedClouds {
  std::vector<Eigen::Vector3d> from, to;

  DisturbedClouds(const Similarity& truth, double sigma, std::mt19937_64& random) {
    std::uniform_real_distribution<double> place(-1000, 1000);
    std::normal_distribution<double> normal(0, 1);
    const auto noise = [&]() -> Eigen::Vector3d {
      return sigma * Eigen::Vector3d(normal(random), normal(random), normal(random));
    };
    for (int i = 0; i < 1000; ++i) {
      const Eigen::Vector3d x(place(random), place(random), place(random));
      from.push_back(x + noise());
      to.push_back(truth(x) + noise());
    }
  }
  // Three different points at random.
  std::optional<Similarity> draw(std::mt19937_64& random) const {
    const std::size_t i = random() % 1000, j = (i + 1 + random() % 999) % 1000;
    std::size_t k = random() % 1000;
    while (k == i || k == j) k = random() % 1000;
    return solve_similarity({from[i], from[j], from[k]}, {to[i], to[j], to[k]});
  }
};

struct SimilarityErrors {
  std::vector<double> rotation_deg, translation, scale;

  void add(const Similarity& found, const Similarity& truth) {
    rotation_deg.push_back(degrees(rotation_angle(found.rotation, truth.rotation)));
    translation.push_back((found.translation - truth.translation).norm());
    scale.push_back(std::abs(found.scale / truth.scale - 1));
  }
};
double largest(const std::vector<double>& values) {
  double result = 0;
  for (const double value : values) keep_largest(result, value);
  return result;
}

TEST(Spec, AT29SimilarityFromThreePointsIsExact) {
  std::mt19937_64 random(29);
  SimilarityErrors errors;
  ASSERT_EQ(configurations().size(), 27u);
  for (const Similarity& truth : configurations()) {
    const DisturbedClouds clouds(truth, 0, random);
    for (int draw = 0; draw < 500; ++draw) {
      const auto found = clouds.draw(random);
      ASSERT_TRUE(found);
      errors.add(*found, truth);
    }
  }
  for (double& t : errors.translation) t /= 2000;  // of the cube, as a translation may be zero
  expect_at_most(median(errors.rotation_deg), 1e-8, "median rotation, deg");
  expect_at_most(largest(errors.rotation_deg), 1e-8, "largest rotation, deg");
  expect_at_most(largest(errors.scale), 1e-12, "largest scale");
  expect_at_most(largest(errors.translation), 1e-9, "largest translation, relative");
}

TEST(Spec, AT30SimilarityFromNoisyPoints) {
  for (const auto& [sigma, three_deg, all_deg, all_translation, all_scale] :
       {std::array{0.1, 0.04, 0.0015, 0.03, 3e-5}, std::array{0.5, 0.2, 0.007, 0.2, 7e-5}}) {
    std::mt19937_64 random(30);
    double worst_median = 0;
    SimilarityErrors all;
    for (const Similarity& truth : configurations()) {
      const DisturbedClouds clouds(truth, sigma, random);
      SimilarityErrors three;
      for (int draw = 0; draw < 500; ++draw) {
        const auto found = clouds.draw(random);
        ASSERT_TRUE(found);
        three.add(*found, truth);
      }
      keep_largest(worst_median, median(three.rotation_deg));
      all.add(fit_similarity(clouds.from, clouds.to).value(), truth);
    }
    const std::string name = "sigma " + std::to_string(sigma).substr(0, 3) + ": ";
    expect_at_most(worst_median, three_deg, name + "three points, median rotation, deg");
    expect_at_most(largest(all.rotation_deg), all_deg, name + "1000 points, rotation, deg");
    expect_at_most(largest(all.translation), all_translation, name + "1000 points, translation");
    expect_at_most(largest(all.scale), all_scale, name + "1000 points, scale");
  }
}

TEST(Spec, AT31SimilarityWithBlunders) {
  for (const auto& [sigma, limit_deg, limit_translation, limit_scale] :
       {std::array{0.1, 0.0015, 0.03, 3e-5}, std::array{0.5, 0.007, 0.2, 7e-5}}) {
    std::mt19937_64 random(31);
    SimilarityErrors errors;
    double kept = 0, blunders = 0, lost = 0, good = 0;
    for (const Similarity& truth : configurations()) {
      DisturbedClouds clouds(truth, sigma, random);
      std::uniform_real_distribution<double> length(0, 2000);
      // Of the difference of a pair of points.
      const double sigma_pair = sigma * std::sqrt(1 + truth.scale * truth.scale);
      for (std::size_t i = 0; i < 300; ++i) clouds.to[i] += length(random) * random_direction(random);
      std::vector<SimilarityPair> pairs;
      for (std::size_t i = 0; i < 1000; ++i) pairs.push_back({clouds.from[i], clouds.to[i], sigma, sigma});
      // What is more than 5 sigmas off the truth has to go, and the threshold is about the similarity found: 4.5 sigmas
      // of a coordinate, which 1.5e-4 of the good points exceed.
      const auto found = ransac(SimilarityEstimator(pairs), {.threshold = 4.5, .max_draws = 3 * 35, .seed = random()});
      ASSERT_TRUE(found);
      const std::vector<std::uint8_t>& inlier = found->consensus.inlier;
      errors.add(found->model, truth);
      for (std::size_t i = 0; i < 1000; ++i) {
        const double off = (truth(clouds.from[i]) - clouds.to[i]).norm();
        if (i < 300 && off > 5 * sigma_pair) blunders += 1, kept += inlier[i];
        if (i >= 300) good += 1, lost += !inlier[i];
      }
    }
    const std::string name = "sigma " + std::to_string(sigma).substr(0, 3) + ": ";
    expect_at_most(largest(errors.rotation_deg), limit_deg, name + "rotation, deg");
    expect_at_most(largest(errors.translation), limit_translation, name + "translation");
    expect_at_most(largest(errors.scale), limit_scale, name + "scale");
    expect_at_most(kept, 0, name + "blunders kept of " + std::to_string(static_cast<int>(blunders)));
    expect_at_most(lost / good, 1e-3, name + "good points lost");
  }
}

TEST(Spec, AT32SimilarityNearHalfTurns) {
  std::mt19937_64 random(32);
  SimilarityErrors errors;
  for (const double angle : {170.0, 172.0, 174.0, 176.0, 178.0, 179.0, 179.9, 179.99, 180.0}) {
    for (int axis = 0; axis < 6; ++axis) {
      const Eigen::Vector3d about = axis < 3 ? Eigen::Vector3d(Eigen::Vector3d::Unit(axis)) : random_direction(random);
      const Similarity truth{1.5, rotation_exp<double>(angle * std::numbers::pi / 180 * about), {2000, 1000, 500}};
      const DisturbedClouds clouds(truth, 0, random);
      for (int draw = 0; draw < 200; ++draw) {
        const auto found = clouds.draw(random);
        ASSERT_TRUE(found) << angle;
        errors.add(*found, truth);
      }
    }
  }
  expect_at_most(largest(errors.rotation_deg), 1e-9, "largest rotation, deg");
  expect_at_most(largest(errors.scale), 1e-9, "largest scale");
}

}  // namespace
}  // namespace megablock
