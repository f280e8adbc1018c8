// Focal lengths of simulated cameras with known truth: converging and parallel views, wrong matches, lens distortion,
// and pairs that cannot tell.
#include "match/verification/focal_length.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "geometry/numbers/angles.h"
#include "geometry/transform/rotation.h"

namespace megablock {
namespace {

constexpr int kSensorWidth = 2000, kSensorHeight = 1500;  // pixels

struct Scene {
  double focal_px = 1400;
  double relief = 0.5;      // depth of the scene in distances
  double base = 0.3;        // distance of the images in distances to the scene
  double angles_rad = 0.2;  // sigma of the attitudes about each axis, beyond looking at the scene
  bool converging = true;   // the axes meet in the scene, as people take photographs; otherwise they are parallel
  double noise_px = 0.5, wrong = 0.3;
  double k1 = 0;  // radial distortion, on normalised points
  int matches = 300;
  bool rotation_only = false;
};

PointPairs simulate(const Scene& scene, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal(0, 1);
  std::uniform_real_distribution<double> unit(-0.5, 0.5);
  const auto small_turn = [&](double sigma) -> Eigen::Quaterniond {
    return rotation_exp<double>(sigma * Eigen::Vector3d(normal(random), normal(random), normal(random)));
  };
  // Camera a is at the origin and looks along z at the scene at distance 1; b is beside it.
  Eigen::Vector3d centre = scene.base * Eigen::Vector3d(normal(random), normal(random), 0.3 * normal(random));
  if (centre.norm() < 0.5 * scene.base) centre *= 0.5 * scene.base / centre.norm();
  if (scene.rotation_only) centre.setZero();
  const Eigen::Quaterniond look =
      scene.converging ? Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d(0, 0, 1) - centre, Eigen::Vector3d(0, 0, 1))
                       : Eigen::Quaterniond::Identity();
  const Eigen::Quaterniond turn_a = small_turn(scene.angles_rad), turn_b = small_turn(scene.angles_rad) * look;
  const auto distorted = [&](const Eigen::Vector3d& inside) -> Eigen::Vector2d {
    const Eigen::Vector2d x = inside.hnormalized();
    return scene.focal_px * (1 + scene.k1 * x.squaredNorm()) * x +
           scene.noise_px * Eigen::Vector2d(normal(random), normal(random));
  };
  const auto inside_image = [](const Eigen::Vector2d& p) {
    return std::abs(p.x()) < 0.5 * kSensorWidth && std::abs(p.y()) < 0.5 * kSensorHeight;
  };
  PointPairs pairs;
  for (int tries = 0; pairs.size() < static_cast<std::size_t>(scene.matches) && tries < 200000; ++tries) {
    const double depth = 1 + scene.relief * unit(random);
    const Eigen::Vector3d point = depth * Eigen::Vector3d(3 * unit(random), 3 * unit(random), 1);
    const Eigen::Vector3d in_a = turn_a * point, in_b = turn_b * (point - centre);
    if (in_a.z() < 0.1 || in_b.z() < 0.1) continue;
    const Eigen::Vector2d a = distorted(in_a);
    Eigen::Vector2d b = distorted(in_b);
    if (!inside_image(a) || !inside_image(b)) continue;
    if (unit(random) + 0.5 < scene.wrong) b = {kSensorWidth * unit(random), kSensorHeight * unit(random)};
    pairs.a.push_back(a);
    pairs.b.push_back(b);
  }
  return pairs;
}

MatchedBatch batches_of(const std::vector<MatchedImages>& pairs) {
  return [&pairs](std::size_t first, std::size_t end) {
    return std::vector<MatchedImages>(pairs.begin() + static_cast<std::ptrdiff_t>(first),
                                      pairs.begin() + static_cast<std::ptrdiff_t>(end));
  };
}

std::vector<MatchedImages> pairs_in(const Scene& scene, std::uint64_t seed, std::size_t count) {
  std::vector<MatchedImages> pairs(count);
  for (std::size_t i = 0; i < count; ++i) {
    pairs[i].seed = seed * 1000 + i;
    pairs[i].pixels = simulate(scene, pairs[i].seed);
  }
  return pairs;
}

std::optional<FocalLength> found_in(const Scene& scene, std::uint64_t seed, std::size_t count = 12, int threads = 2) {
  const std::vector<MatchedImages> pairs = pairs_in(scene, seed, count);
  FocalLengthOptions options;
  options.threads = threads;
  return focal_length_of(pairs.size(), batches_of(pairs), kSensorWidth, kSensorHeight, options);
}

// Within 2 %, and within four sigmas.
void expect_found(const Scene& scene, std::uint64_t seed = 1) {
  const auto found = found_in(scene, seed);
  ASSERT_TRUE(found) << scene.focal_px;
  const double error = found->focal_px / scene.focal_px - 1;
  EXPECT_LT(std::abs(error), 0.02) << scene.focal_px;
  EXPECT_LT(std::abs(error), 4 * found->sigma()) << scene.focal_px;
  EXPECT_GE(found->asked, 8);  // of 12; images of a long lens may hardly overlap
  EXPECT_FALSE(found->open);
  EXPECT_LT(found->sigma(), 0.1);
}

// From wide to tele. The axes of the images meet nearly, where the closed formula fails.
TEST(FocalLength, OfCamerasThatLookAtAScene) {
  for (const double focal : {800.0, 1400.0, 3000.0}) {
    Scene scene;
    scene.focal_px = focal;
    expect_found(scene);
  }
}

TEST(FocalLength, OfImagesThatMeetInTheScene) {
  Scene scene;
  scene.angles_rad = 0.003;
  expect_found(scene);
}

TEST(FocalLength, OfAStrip) {
  Scene scene;
  scene.converging = false;
  scene.angles_rad = 0.05;
  expect_found(scene);
}

TEST(FocalLength, WithManyWrongMatches) {
  Scene scene;
  scene.wrong = 0.65;
  scene.matches = 600;
  expect_found(scene);
}

// Both are 8 % in the corners; the focal length would be 18 % wrong for the first.
TEST(FocalLength, OfLensesThatDistort) {
  Scene barrel, cushion;
  barrel.k1 = -0.1;
  expect_found(barrel);
  cushion.k1 = 0.1;
  expect_found(cushion);
}

// Nearly flat ground from above does not tell the distortion either; a deep scene does.
TEST(FocalLength, FlatGroundAllowsOtherDistortions) {
  constexpr double kTrueQ = 0.02;
  Scene flat, deep;
  flat.relief = 0.05, flat.converging = false, flat.angles_rad = 0.03;
  deep.relief = 1;
  const double corner = 0.5 * std::hypot(kSensorWidth, kSensorHeight) / flat.focal_px;
  flat.k1 = deep.k1 = -kTrueQ / (corner * corner);
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const auto others_of = [&](const Scene& scene) {
      const std::vector<MatchedImages> pairs = pairs_in(scene, seed, 12);
      const auto found = focal_length_of(pairs.size(), batches_of(pairs), kSensorWidth, kSensorHeight, {});
      std::vector<double> all =
          likely_distortions(pairs.size(), batches_of(pairs), kSensorWidth, kSensorHeight, {}, found.value());
      EXPECT_TRUE(std::ranges::is_sorted(all, {}, [&](double q) { return std::abs(q - found->distortion); }));
      all.push_back(found->distortion);
      return all;
    };
    const auto near_truth = [&](double q) { return std::abs(q - kTrueQ) <= 0.03; };
    EXPECT_TRUE(std::ranges::any_of(others_of(flat), near_truth)) << seed;
    EXPECT_GE(others_of(flat).size(), 2U) << seed;
    EXPECT_LE(others_of(deep).size(), 2U) << seed;
    EXPECT_TRUE(std::ranges::any_of(others_of(deep), near_truth)) << seed;
  }
}

// Parallel axes over flat ground: every focal length explains the matches.
TEST(FocalLength, IsNotToldByFlatGroundFromAbove) {
  Scene scene;
  scene.relief = 0;
  scene.converging = false;
  scene.angles_rad = 0;
  const auto found = found_in(scene, 1);
  ASSERT_TRUE(found);
  EXPECT_TRUE(found->open);
  EXPECT_LT(found->against(scene.focal_px), 2);  // of 12 pairs, some of which noise deceives
}

// An orientation explains the images of a plane with any focal length, and has to be found. (Among many wrong matches F
// takes up some that agree with it by chance, and a pair may then prefer any focal length.)
TEST(FocalLength, APlaneContradictsNone) {
  Scene scene;
  scene.relief = 0;
  scene.wrong = 0;
  const auto found = found_in(scene, 1);
  ASSERT_TRUE(found);
  for (const double factor : {0.5, 0.7, 1.0, 1.4, 3.0})
    EXPECT_LT(found->against(factor * scene.focal_px), 1.5) << factor;  // of 12 pairs
}

// A header that is wrong by a factor of ten is contradicted by nearly all pairs, the right one by none.
TEST(FocalLength, ContradictsAWrongHeader) {
  const auto found = found_in({}, 1);
  ASSERT_TRUE(found);
  EXPECT_GT(found->against(14000), 10);
  EXPECT_GT(found->against(700), 10);
  EXPECT_LT(found->against(1400), 1);
}

TEST(FocalLength, IsNotToldByWrongMatchesOrFewPairs) {
  Scene scene;
  EXPECT_FALSE(found_in(scene, 1, 4));
  scene.wrong = 1;
  EXPECT_FALSE(found_in(scene, 1));
}

// One pair in four has another focal length, as if the lens had been changed.
TEST(FocalLength, IsThatOfMostPairs) {
  std::vector<MatchedImages> pairs;
  for (std::uint64_t i = 0; i < 12; ++i) {
    Scene scene;
    scene.focal_px = i % 4 == 0 ? 2400 : 1400;
    pairs.push_back({simulate(scene, 500 + i), i});
  }
  const auto found = focal_length_of(pairs.size(), batches_of(pairs), kSensorWidth, kSensorHeight);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->focal_px, 1400, 0.03 * 1400);
}

TEST(FocalLength, DoesNotDependOnThreads) {
  const auto one = found_in({}, 1, 6, 1), two = found_in({}, 1, 6, 2);
  ASSERT_TRUE(one && two);
  EXPECT_EQ(one->focal_px, two->focal_px);
  EXPECT_EQ(one->votes, two->votes);
  EXPECT_EQ(one->distortion, two->distortion);
}

}  // namespace
}  // namespace megablock
