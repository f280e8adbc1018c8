// Acceptance tests of robust estimation: draws, determinism, model selection, and three points with the vertical
// against five.
#include <gtest/gtest.h>

#include <chrono>
#include <limits>
#include <random>
#include <thread>
#include <tuple>

#include "geometry/estimation/ransac.h"
#include "geometry/resection/resection_estimators.h"
#include "geometry/similarity/similarity_estimator.h"
#include "geometry/two_view/homography.h"
#include "geometry/two_view/pair_estimators.h"
#include "geometry/vanishing/vanishing_circles.h"
#include "geometry/vanishing/vanishing_points.h"
#include "io/text/counted.h"
#include "match/verification/two_view.h"
#include "reached.h"
#include "tests/support/geometry/linear_model.h"
#include "tests/support/geometry/scene_pairs.h"
#include "tests/support/geometry/segment_scenes.h"

namespace megablock {
namespace {

constexpr std::array kShares = {0.95, 0.9, 0.8, 0.75, 0.7, 0.6, 0.5};
constexpr std::array<std::array<int, 7>, 7> kTableA1 = {{{2, 3, 5, 6, 7, 11, 17},
                                                         {3, 4, 7, 9, 11, 19, 35},
                                                         {3, 5, 9, 13, 17, 34, 72},
                                                         {4, 6, 12, 17, 26, 57, 146},
                                                         {4, 7, 16, 24, 37, 97, 293},
                                                         {4, 8, 20, 33, 54, 163, 588},
                                                         {5, 9, 26, 44, 78, 272, 1177}}};  // samples of 2 to 8

TEST(Spec, AT17TableOfDraws) {
  int different = 0;
  for (std::size_t n = 2; n <= 8; ++n)
    for (std::size_t w = 0; w < 7; ++w) different += draws_needed(n, kShares[w], 0.99) != kTableA1[n - 2][w];
  expect_at_most(different, 0, "entries of the table that differ, of 49");
}

// Draws over those of the table, mean and largest of 100 runs for each of the seven shares; right observations have
// normal errors. With p = 0.99 nearly all runs must find the model, too.
template <int N>
void expect_draws_of_table(bool share_known) {
  double worst_mean = 0, worst = 0, right = 0;
  for (std::size_t w = 0; w < 7; ++w) {
    double sum = 0;
    for (std::uint64_t seed = 0; seed < 100; ++seed) {
      const LinearModelScene<N> scene(200, 1 - kShares[w], 0.01, seed);
      RansacOptions options{.threshold = threshold_of_sigma(0.01, 1, 0.999), .seed = seed};
      if (share_known) options.inlier_share = kShares[w];
      const auto found = ransac(LinearModelEstimator<N>(scene), options);
      const double ratio = found ? found->draws / static_cast<double>(kTableA1[N - 2][w]) : 100;
      sum += ratio;
      right += found && (found->model - scene.truth).norm() < 0.05;
      keep_largest(worst, ratio);
    }
    keep_largest(worst_mean, sum / 100);
  }
  const std::string name = "samples of " + std::to_string(N) + (share_known ? ", share known: " : ", share found: ");
  // What the share is the engine finds to one observation in some hundred: mean draws of few are up or down by one.
  expect_at_most(worst_mean, 1.2, name + "mean draws over the table's");
  if (share_known) expect_at_most(worst, 1.2, name + "most draws over the table's");
  expect_at_least(right / 700, 0.97, name + "share of runs that find the model");
}

TEST(Spec, AT17AdaptiveDraws) {
  for (const bool known : {true, false}) {
    expect_draws_of_table<2>(known);
    expect_draws_of_table<3>(known);
    expect_draws_of_table<4>(known);
    expect_draws_of_table<5>(known);
    expect_draws_of_table<6>(known);
    expect_draws_of_table<7>(known);
    expect_draws_of_table<8>(known);
  }
}

struct TiltedPair {
  PairScene scene;
  PointPairs points;
  Eigen::Vector3d down_a, down_b;
};

TiltedPair tilted_pair(PairSceneOptions options, std::size_t count, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> tilt(-0.1, 0.1);
  const auto turn = [&] { return rotation_exp<double>({tilt(random), tilt(random), tilt(random)}); };
  const Eigen::Quaterniond a = turn(), b = turn();
  options.rotation = b * a.conjugate();
  const PairScene scene(options, count, random);
  return {scene, normalised_points(scene), a * Eigen::Vector3d::UnitY(), b * Eigen::Vector3d::UnitY()};
}

PairSceneOptions half_wrong() {
  PairSceneOptions options;
  options.noise_px = 0.3;
  options.outliers = 0.5;
  return options;
}
constexpr double kThreshold = 1 / kSceneFocalPx;

TwoViewOptions given_verticals(const TiltedPair& pair, TwoViewOptions options) {
  const Eigen::Matrix3d covariance = std::pow(0.1 * kDegree, 2) * Eigen::Matrix3d::Identity();
  options.vertical_a = AxisDirection{pair.down_a, covariance};
  options.vertical_b = AxisDirection{pair.down_b, covariance};
  return options;
}

// Seconds, the best of three calls: other programs may be at work.
template <typename Call>
double seconds_of(const Call& call) {
  double best = std::numeric_limits<double>::infinity();
  for (int repetition = 0; repetition < 3; ++repetition) {
    const auto start = std::chrono::steady_clock::now();
    call();
    best = std::min(best, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
  return best;
}

TEST(Spec, AT37ThreePointsAgainstFive) {
  constexpr int kPairs = 40;
  double draws_three = 0, draws_five = 0, time_three = 0, time_five = 0, wrong = 0;
  double verified_three = 0, verified_five = 0;  // times of the whole verification
  for (std::uint64_t seed = 0; seed < kPairs; ++seed) {
    const TiltedPair pair = tilted_pair(half_wrong(), 600, seed);
    const FivePointEstimator five(pair.points, kThreshold);
    const VerticalPairEstimator three(pair.points, kThreshold, pair.down_a, pair.down_b);
    const RansacOptions options{.threshold = kThreshold, .inlier_share = 0.5, .seed = seed};
    const auto run = [&](const auto& estimator, double& draws, double& time) {
      std::optional<RansacResult<RelativeOrientation>> found;
      time += seconds_of([&] { found = ransac(estimator, options); });
      draws += found->draws;
      wrong += rotation_error_deg(found->model, pair.scene.truth) > 0.5;
    };
    run(three, draws_three, time_three);
    run(five, draws_five, time_five);
    const TwoViewOptions without{.max_residual = kThreshold, .seed = seed}, with = given_verticals(pair, without);
    verified_three += seconds_of([&] { EXPECT_TRUE(estimate_two_view(pair.points, with).by_vertical) << seed; });
    verified_five += seconds_of([&] { estimate_two_view(pair.points, without); });
  }
  expect_at_most(draws_three / kPairs, 35, "mean draws, three points");
  expect_at_most(draws_five / kPairs, 146, "mean draws, five points");
  expect_at_most(time_three / time_five, 0.4, "time of the samples over that of five points");
  // 0.4 is asked for. Refinements, tests of models and the covariance take as long with three points.
  expect_at_most(verified_three / verified_five, 0.7, "time of the whole verification over that of five points");
  expect_at_most(wrong, 4, "of 80 runs with p = 0.99, rotations off by more than half a degree");
}

// What `find` makes of the items 0, 1, ..., shared out to so many threads.
template <typename Find>
auto on_threads(std::size_t threads, std::size_t items, const Find& find) {
  std::vector<decltype(find(std::size_t{}))> found(items);
  std::vector<std::thread> workers;
  for (std::size_t worker = 0; worker < threads; ++worker)
    workers.emplace_back([&, worker] {
      for (std::size_t i = worker; i < items; i += threads) found[i] = find(i);
    });
  for (std::thread& worker : workers) worker.join();
  return found;
}
template <typename Find>
void expect_same_on_any_threads(std::size_t items, const Find& find) {
  const auto reference = on_threads(1, items, find);
  for (const std::size_t threads : {8, 64}) EXPECT_TRUE(on_threads(threads, items, find) == reference) << threads;
}

TEST(Spec, AT35SameInliersForAnyNumberOfThreads) {
  constexpr std::size_t kPairs = 64;
  std::vector<TiltedPair> pairs;
  for (std::uint64_t seed = 0; seed < kPairs; ++seed) pairs.push_back(tilted_pair(half_wrong(), 150, seed));
  for (const bool by_verticals : {false, true})
    expect_same_on_any_threads(kPairs, [&](std::size_t i) {
      const TwoViewOptions options{.max_residual = kThreshold, .seed = i};
      const TwoView found =
          estimate_two_view(pairs[i].points, by_verticals ? given_verticals(pairs[i], options) : options);
      EXPECT_EQ(found.by_vertical, by_verticals) << i;
      EXPECT_GT(found.inlier_count, 0) << i;
      return std::tuple(found.inlier, Eigen::Vector4d(found.rotation.coeffs()), Eigen::Vector3d(found.translation),
                        found.draws);
    });
}

TEST(Spec, AT35SameSimilaritiesForAnyNumberOfThreads) {
  constexpr std::size_t kSets = 64;
  std::mt19937_64 random(35);
  std::normal_distribution<double> normal(0, 1);
  const auto place = [&](double sigma) {
    const double x = normal(random), y = normal(random), z = normal(random);
    return Eigen::Vector3d(sigma * Eigen::Vector3d(x, y, z));
  };
  std::vector<std::vector<SimilarityPair>> sets(kSets);
  for (auto& pairs : sets)
    for (int i = 0; i < 60; ++i) {
      const Eigen::Vector3d from = place(100);
      pairs.push_back({from, i % 2 == 0 ? place(100) : Eigen::Vector3d(2 * from + place(0.1)), 0, 0.1});
    }
  expect_same_on_any_threads(kSets, [&](std::size_t i) {
    const auto found = ransac(SimilarityEstimator(sets[i]), {.threshold = threshold_of_sigma(1, 3), .seed = i});
    EXPECT_TRUE(found && found->consensus.count > 0) << i;
    return found ? std::tuple(found->consensus.inlier, found->model.scale, found->draws)
                 : std::tuple(std::vector<std::uint8_t>(), 0.0, 0);
  });
}

TEST(Spec, AT35SameVanishingPointsForAnyNumberOfThreads) {
  constexpr std::size_t kPictures = 16;
  using fixture::SegmentScene;
  const auto scene = [](std::size_t i) { return fixture::urban_scene(i + 35, {0.05, -0.1}, 3); };
  expect_same_on_any_threads(kPictures, [&](std::size_t i) {
    const VanishingPoints found = find_vanishing_points(scene(i).planes(), {.seed = i});
    EXPECT_FALSE(found.points.empty()) << i;
    std::vector<Eigen::Vector3d> directions;
    for (const VanishingPoint& point : found.points) directions.push_back(point.axis.direction);
    return std::pair(found.point_of, directions);
  });
  expect_same_on_any_threads(kPictures, [&](std::size_t i) {
    const SegmentScene image = scene(i);
    std::vector<std::vector<int>> lines;
    for (const CirclePoint& point : find_vanishing_points_by_circles(image.lines(), image.width, image.height))
      lines.push_back(point.lines);
    EXPECT_TRUE(!lines.empty() && !lines.front().empty()) << i;
    return lines;
  });
}

// Observations of a camera, half of which are outliers.
TEST(Spec, AT35SameResectionsForAnyNumberOfThreads) {
  constexpr std::size_t kPictures = 64;
  std::mt19937_64 random(36);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<std::vector<PointRay>> images(kPictures);
  for (auto& rays : images)
    for (int i = 0; i < 80; ++i) {
      const double x = uniform(random), y = uniform(random), depth = 4 + 2 * uniform(random);
      const Eigen::Vector3d inside = depth * Eigen::Vector3d(x, y, 1);
      const double u = uniform(random), v = uniform(random);
      const Eigen::Vector3d seen = i % 2 == 0 ? Eigen::Vector3d(u, v, 1) : inside;
      rays.push_back({Eigen::Vector3d::Zero(), seen.normalized(), inside + Eigen::Vector3d(10, 20, 30)});
    }
  expect_same_on_any_threads(kPictures, [&](std::size_t i) {
    const auto found = ransac(ResectionEstimator(images[i]), {.threshold = 1e-3, .seed = i});
    EXPECT_TRUE(found && found->consensus.count > 0) << i;
    return found ? std::tuple(found->consensus.inlier, Eigen::Vector3d(found->model.centre), found->draws)
                 : std::tuple(std::vector<std::uint8_t>(), Eigen::Vector3d(0, 0, 0), 0);
  });
}

TwoView two_view(const PairSceneOptions& options, std::uint64_t seed, RelativeOrientation* truth = nullptr,
                 std::size_t matches = 300) {
  const TiltedPair pair = tilted_pair(options, matches, seed);
  if (truth) *truth = pair.scene.truth;
  return estimate_two_view(pair.points,
                           {.max_residual = std::max(4 * options.noise_px, 1.0) / kSceneFocalPx, .seed = seed});
}

// The orientations that the true plane has, refined, with their support, best first: what estimate_two_view should find
// without sampling anything.
std::vector<std::pair<double, RelativeOrientation>> orientations_of_true_plane(const TiltedPair& pair,
                                                                               const Eigen::Vector3d& base,
                                                                               double threshold) {
  // Depth 2: X_b = R X_a + t = (R + t n' / 2) X_a with n the optical axis of a.
  const Eigen::Matrix3d homography =
      pair.scene.truth.rotation.toRotationMatrix() + 0.5 * base * Eigen::Vector3d::UnitZ().transpose();
  const FivePointEstimator estimator(pair.points, threshold);
  std::vector<std::pair<double, RelativeOrientation>> found;
  for (const PlanarOrientation& planar : visible_orientations(homography, pair.scene.a)) {
    const RelativeOrientation refined = adjust_orientation(planar.orientation, pair.points, {0.5 * threshold});
    found.emplace_back(consensus_of(estimator, refined, threshold).score, refined);
  }
  std::sort(found.begin(), found.end(), [](const auto& p, const auto& q) { return p.first > q.first; });
  return found;
}

TEST(Spec, AT06PlanesKeepTheirTwin) {
  constexpr double kNoisePx = 0.5, kTwinShare = 0.95;
  double planes = 0, missed = 0, invented = 0, near = 0, expected = 0, pairs = 0;
  // Along the plane no second orientation has all points in front of both images; with a part along its normal one has.
  for (const Eigen::Vector3d& base :
       {Eigen::Vector3d(0.1, 0, 0), Eigen::Vector3d(0.08, 0, 0.06), Eigen::Vector3d(0.24, 0, -0.18)})
    for (std::uint64_t seed = 0; seed < 20; ++seed) {
      PairSceneOptions options;
      options.plane = true;
      options.base = base;
      options.noise_px = kNoisePx;
      const TiltedPair pair = tilted_pair(options, 2000, seed);
      const double threshold = 4 * kNoisePx / kSceneFocalPx;
      const TwoView found = estimate_two_view(pair.points, {.max_residual = threshold, .seed = seed});
      const auto right = orientations_of_true_plane(pair, base, threshold);
      ++pairs;
      planes += found.model == PairModel::kHomography;
      const auto apart = [](const RelativeOrientation& p, const RelativeOrientation& q) {
        return std::max(rotation_error_deg(p, q), base_error_deg(p, q));
      };
      const RelativeOrientation best{found.rotation, found.translation};
      const bool twin = right.size() > 1 && right[1].first > kTwinShare * right[0].first &&
                        apart(right[0].second, right[1].second) > 3;
      expected += twin;
      // Those reported are the two of the plane, in any order; the limit is that of the base's largest error.
      constexpr double kSame = 9;
      if (twin) {
        const auto matches = [&](std::size_t i, std::size_t j) {
          return found.twin && apart(best, right[i].second) < kSame && apart(*found.twin, right[j].second) < kSame;
        };
        missed += !matches(0, 1) && !matches(1, 0);
      } else {
        invented += found.twin.has_value();
      }
      double nearest = rotation_error_deg(best, pair.scene.truth) + base_error_deg(best, pair.scene.truth);
      if (found.twin)
        nearest = std::min(
            nearest, rotation_error_deg(*found.twin, pair.scene.truth) + base_error_deg(*found.twin, pair.scene.truth));
      near += nearest < kSame;
    }
  const std::string of = ", of " + std::to_string(static_cast<int>(pairs));
  expect_at_most(pairs - planes, 0, "planes not recognised" + of);
  expect_at_least(expected, 20, "pairs with two orientations within 5 percent of support" + of);
  expect_at_most(missed, 0, "of these without the right twin");
  std::printf("[ reached  ] of the others with a twin, just within 5 percent of what was found: %.0f\n", invented);
  expect_at_most(pairs - near, 0, "planes where neither orientation is within 9 deg of the truth" + of);
}

TEST(Spec, AT07AlongTheNormalIsIllConditioned) {
  for (const double noise_px : {0.1, 0.5, 1.0}) {
    int flagged = 0, counted = 0;
    double over_sigma = 0, squares = 0;
    for (std::uint64_t seed = 0; seed < 50; ++seed) {
      PairSceneOptions options;
      options.plane = true;
      options.base = {0, 0, 0.1};
      options.noise_px = noise_px;
      RelativeOrientation truth;
      const TwoView found = two_view(options, seed, &truth);
      flagged += found.ill_conditioned;
      if (found.model == PairModel::kRotationOnly) continue;
      const double error = base_error_deg({found.rotation, found.translation}, truth);
      const double over = error / degrees(found.precision.base_sigma());
      keep_largest(over_sigma, over);
      squares += over * over;
      ++counted;
    }
    const std::string name = " at " + std::to_string(noise_px).substr(0, 3) + " px";
    expect_at_most(50 - flagged, 0, "pairs of 50 without the flag" + name);
    expect_at_most(over_sigma, 3, "largest error of the base over its sigma" + name);
    const double rms = std::sqrt(squares / std::max(1, counted));
    expect_at_least(rms, 0.5, "rms error of the base over its sigma" + name);
    expect_at_most(rms, 1.2, "rms error of the base over its sigma" + name);
  }
  int flagged = 0;
  for (std::uint64_t seed = 0; seed < 50; ++seed) flagged += two_view(half_wrong(), seed).ill_conditioned;
  expect_at_most(flagged, 0, "of 50 general pairs with the flag");
}

TEST(Spec, AT08RotationOnly) {
  for (const double noise_px : {0.2, 0.5}) {
    int missed = 0, false_flags = 0;
    for (std::uint64_t seed = 0; seed < 100; ++seed) {
      PairSceneOptions options;
      options.noise_px = noise_px;
      options.base.setZero();
      missed += two_view(options, seed).model != PairModel::kRotationOnly;
      for (const bool lateral : {true, false}) {
        options.base = lateral ? Eigen::Vector3d(0.05, 0, 0) : Eigen::Vector3d(0, 0, 0.05);
        false_flags += two_view(options, seed).model == PairModel::kRotationOnly;
      }
    }
    const std::string name = " at " + std::to_string(noise_px).substr(0, 3) + " px";
    expect_at_most(missed / 100.0, 0.01, "share of pairs without base that are not rotation-only" + name);
    expect_at_most(false_flags / 200.0, 0.01, "share of pairs with base 0.05 that are rotation-only" + name);
  }
}

TEST(Spec, AT26RealPairs) { GTEST_SKIP() << "the photographs of entry-P10 (Strecha et al. 2008) are not available"; }
TEST(Spec, AT27RealPairs) { GTEST_SKIP() << "the photographs of the ISPRS sequence \"stones\" are not available"; }

}  // namespace
}  // namespace megablock
