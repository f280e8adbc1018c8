// RANSAC for pairs of images: the truth among half wrong matches, for every estimator.
#include "geometry/two_view/pair_estimators.h"

#include <gtest/gtest.h>

#include "geometry/estimation/ransac.h"
#include "geometry/two_view/fundamental.h"
#include "geometry/two_view/homography.h"
#include "tests/support/geometry/scene_pairs.h"

namespace megablock {
namespace {

constexpr double kLimit = 1.5 / kSceneFocalPx;

PairScene half_wrong_scene(const Eigen::Vector3d& base, bool plane, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  PairSceneOptions options;
  options.rotation = rotation_exp<double>({0, 0.2, 0});
  options.base = base;
  options.plane = plane;
  options.noise_px = 0.3;
  options.outliers = 0.5;
  return PairScene(options, 500, random);
}

// The model of the right half of the matches.
template <typename Estimator>
RansacResult<typename Estimator::Model> found_half(const Estimator& estimator, const RansacOptions& options) {
  const auto found = ransac(estimator, options);
  EXPECT_NEAR(found.value().consensus.count, 250, 45);
  EXPECT_GT(estimator.chance(kLimit), 0);
  EXPECT_LT(estimator.chance(kLimit), 0.1);
  EXPECT_EQ(estimator.chance(1e3), 1);
  return *found;
}

TEST(PairEstimators, FindTheTruthAmongHalfWrongMatches) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    // Both with a given threshold and with one chosen a contrario.
    for (const RansacOptions& options : {RansacOptions{.threshold = kLimit, .seed = seed},
                                         RansacOptions{.max_threshold = 30 * kLimit, .seed = seed}}) {
      const PairScene scene = half_wrong_scene({0.3, 0, 0.05}, false, seed);
      const PointPairs points = normalised_points(scene);
      const auto by_five = found_half(FivePointEstimator(points, kLimit), options);
      EXPECT_LT(rotation_error_deg(by_five.model, scene.truth), 0.3);
      EXPECT_LT(base_error_deg(by_five.model, scene.truth), 1);
      EXPECT_LT(by_five.threshold, 3 * kLimit);

      const Eigen::Vector3d down = Eigen::Vector3d::UnitY();
      const auto by_three = found_half(VerticalPairEstimator(points, kLimit, down, down), options);
      EXPECT_LT(base_error_deg(by_three.model, scene.truth), 1);
      EXPECT_LT(by_three.draws, by_five.draws);

      found_half(FundamentalEstimator(points), options);

      const PairScene plane = half_wrong_scene({0.3, 0, 0.05}, true, seed);
      const PointPairs plane_points = normalised_points(plane);
      const auto by_four = found_half(HomographyEstimator(plane_points), options);
      EXPECT_LT(nearest_error_deg(
                    [&] {
                      std::vector<RelativeOrientation> found;
                      for (const PlanarOrientation& o : orientations_of_homography(by_four.model))
                        found.push_back(o.orientation);
                      return found;
                    }(),
                    plane.truth),
                6);

      const PairScene still = half_wrong_scene({0, 0, 0}, false, seed);
      const PointPairs still_points = normalised_points(still);
      const auto by_two = found_half(RotationPairEstimator(still_points), options);
      EXPECT_LT(degrees(rotation_angle(by_two.model, still.truth.rotation)), 0.05);
    }
  }
}

TEST(PairEstimators, FourPointsOfAPlane) {
  std::mt19937_64 random(6);
  int found = 0;
  for (int trial = 0; trial < 300; ++trial) {
    PairSceneOptions options;
    options.plane = true;
    options.rotation = rotation_exp<double>(0.3 * random_direction(random));
    options.base = 0.5 * random_direction(random);
    const PairScene scene(options, 5, random);
    const auto a = scene.first<4>(scene.a), b = scene.first<4>(scene.b);
    const auto closed = solve_four_point_homography(a, b);
    const auto squares = fit_homography(a, b);
    ASSERT_EQ(closed.has_value(), squares.has_value());
    if (!closed) continue;
    ++found;
    EXPECT_LT((*closed / closed->norm() - *squares / squares->norm()).norm(), 1e-6);
    EXPECT_LT(angle_between(*closed * scene.a[4], scene.b[4]), 1e-6);
  }
  EXPECT_GT(found, 280);
}

TEST(PairEstimators, NothingForFourBadPoints) {
  std::mt19937_64 random(16);
  PairSceneOptions options;
  options.plane = true;
  options.rotation = rotation_exp<double>({0.1, 0.2, -0.1});
  const PairScene scene(options, 4, random);
  const auto a = scene.first<4>(scene.a), b = scene.first<4>(scene.b);
  ASSERT_TRUE(solve_four_point_homography(a, b));
  for (std::size_t i = 0; i < 4; ++i) {
    auto bad_a = a, bad_b = b;
    bad_a[i].y() = bad_b[i].x() = std::nan("");
    EXPECT_FALSE(solve_four_point_homography(bad_a, b)) << i;
    EXPECT_FALSE(solve_four_point_homography(a, bad_b)) << i;
    const std::size_t next = (i + 1) % 4, last = (i + 3) % 4;
    bad_a = a, bad_b = b;
    bad_a[i] = a[next];
    bad_b[i] = b[next];
    EXPECT_FALSE(solve_four_point_homography(bad_a, bad_b)) << "two points are one, " << i;
    EXPECT_FALSE(solve_four_point_homography(bad_a, b)) << "in one image, " << i;
    EXPECT_FALSE(solve_four_point_homography(a, bad_b)) << "in one image, " << i;
    bad_a[i] = a[next] + 0.4 * (a[last] - a[next]);
    bad_b[i] = b[next] + 0.7 * (b[last] - b[next]);
    EXPECT_FALSE(solve_four_point_homography(bad_a, bad_b)) << "three on one line, " << i;
    EXPECT_FALSE(solve_four_point_homography(bad_a, b)) << "in one image, " << i;
  }
}

TEST(PairEstimators, PointsBehindAreNoInliers) {
  std::mt19937_64 random(7);
  const PairScene scene({.base = {0.3, 0.02, 0}}, 400, random);
  const PointPairs points = normalised_points(scene);
  const FivePointEstimator estimator(points, kLimit);
  EXPECT_EQ(consensus_of(estimator, scene.truth, kLimit).count, 400);
  EXPECT_LT(consensus_of(estimator, {scene.truth.rotation, -scene.truth.base}, kLimit).count, 20);
  // A homography that takes points behind the image.
  EXPECT_EQ(consensus_of(HomographyEstimator(points), -Eigen::Matrix3d::Identity(), 1e3).count, 0);
}

// The smallest distance, in the image a, between points of the drawn samples.
double closest_of_samples(const PointPairs& points, double spacing) {
  struct Watched : FivePointEstimator {
    Watched(const PointPairs& p, double s) : FivePointEstimator(p, kLimit, s), points(p) {}
    Solutions<RelativeOrientation, 10> solve(const std::array<std::size_t, 5>& rows) const {
      for (std::size_t k = 1; k < 5; ++k)
        for (std::size_t j = 0; j < k; ++j) closest = std::min(closest, (points.a[rows[j]] - points.a[rows[k]]).norm());
      return FivePointEstimator::solve(rows);
    }
    const PointPairs& points;
    mutable double closest = std::numeric_limits<double>::infinity();
  };
  const Watched estimator(points, spacing);
  EXPECT_TRUE(ransac(estimator, {.threshold = kLimit, .min_draws = 300, .seed = 1}));
  return estimator.closest;
}

TEST(PairEstimators, PointsOfSamplesAreSpreadOut) {
  const PointPairs points = normalised_points(half_wrong_scene({0.3, 0, 0.05}, false, 9));
  const double spacing = 50 / kSceneFocalPx;
  EXPECT_LT(closest_of_samples(points, 0), 0.1 * spacing);
  EXPECT_GE(closest_of_samples(points, spacing), spacing);
  EXPECT_LT(closest_of_samples(points, 1e3), 1e3) << "no points are so far apart: any sample must do";
}

// Either nothing is found, or the inliers are inliers.
template <typename Estimator>
void expect_harmless(const Estimator& estimator, bool may_find) {
  for (const RansacOptions& options :
       {RansacOptions{.threshold = kLimit, .max_draws = 30}, RansacOptions{.max_threshold = 1, .max_draws = 30}}) {
    const auto found = ransac(estimator, options);
    if (!found) continue;
    EXPECT_TRUE(may_find) << found->consensus.count << " inliers";
    ASSERT_EQ(found->consensus.inlier.size(), estimator.size());
    const auto squared_residual = estimator.squared_residuals(found->model);
    const double limit = options.threshold > 0 ? options.threshold : options.max_threshold;
    int inliers = 0;
    for (std::size_t i = 0; i < estimator.size(); ++i) {
      inliers += found->consensus.inlier[i] != 0;
      if (found->consensus.inlier[i]) {
        EXPECT_LE(squared_residual(i), limit * limit * (1 + 1e-12)) << i;
      }
    }
    EXPECT_EQ(inliers, found->consensus.count);
  }
}

void expect_all_harmless(const PointPairs& points, bool may_find = true) {
  const Eigen::Vector3d down = Eigen::Vector3d::UnitY();
  expect_harmless(FivePointEstimator(points, kLimit), may_find);
  expect_harmless(VerticalPairEstimator(points, kLimit, down, down), may_find);
  expect_harmless(HomographyEstimator(points), may_find);
  expect_harmless(RotationPairEstimator(points), may_find);
  expect_harmless(FundamentalEstimator(points), may_find);
}

TEST(PairEstimators, BadInput) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  expect_all_harmless({}, false);
  expect_all_harmless({{{0.1, 0.1}}, {{0.1, 0.2}}}, false);
  expect_all_harmless({std::vector<Eigen::Vector2d>(50, {0.1, 0.2}), std::vector<Eigen::Vector2d>(50, {0.1, 0.3})});
  expect_all_harmless({std::vector<Eigen::Vector2d>(50, {kNan, 0.2}), std::vector<Eigen::Vector2d>(50, {0.1, kNan})},
                      false);
  PointPairs line;
  for (int i = 0; i < 50; ++i) {
    line.a.emplace_back(0.01 * i, 0.02 * i);
    line.b.emplace_back(0.01 * i + 0.1, 0.02 * i);
  }
  expect_all_harmless(line);
  // Points that are not finite do no harm to the others and are never inliers.
  const PairScene scene = half_wrong_scene({0.3, 0, 0.05}, false, 9);
  PointPairs points = normalised_points(scene);
  for (std::size_t i = 0; i < 100; ++i) points.b[5 * i].x() = kNan;
  const auto found = ransac(FivePointEstimator(points, kLimit), {.threshold = kLimit, .seed = 1});
  ASSERT_TRUE(found);
  EXPECT_LT(base_error_deg(found->model, scene.truth), 1);
  for (std::size_t i = 0; i < 100; ++i) EXPECT_FALSE(found->consensus.inlier[5 * i]);
}

}  // namespace
}  // namespace megablock
