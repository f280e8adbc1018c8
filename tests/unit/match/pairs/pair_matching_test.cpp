// Matching of simulated pairs of images: orientation and inliers against the truth, with and without known verticals,
// turns and trusted orientations.
#include "match/pairs/pair_matching.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "geometry/numbers/angles.h"
#include "geometry/transform/rotation.h"
#include "io/base/error.h"
#include "io/block/tracks.h"

namespace megablock {
namespace {

constexpr int kMatches = 600, kOthers = 400;

Camera make_camera() {
  Camera camera;
  camera.width = 2000;
  camera.height = 1500;
  camera.intrinsics = {1400, 1003, 748, -0.05, 0.01, 0, 0.001, -0.0005};
  return camera;
}

SiftDescriptor random_descriptor(std::mt19937_64& generator) {
  SiftDescriptor d;
  for (auto& v : d) v = static_cast<std::uint8_t>(generator() % 91);
  return d;
}

struct TwoPictures {
  ImageFeatures a, b;
  Eigen::Quaterniond rotation;
  std::vector<std::pair<std::int32_t, std::int32_t>> true_matches;
};

// Row i of a matches row i of b for the first kMatches rows; the other features have no counterpart. The first hundred
// matched keypoints are listed twice, with another orientation.
TwoPictures make_scene() {
  std::mt19937_64 generator(3);
  std::uniform_real_distribution<double> unit(0, 1);
  TwoPictures scene;
  const Camera camera = make_camera();
  scene.rotation = rotation_exp<double>(Eigen::Vector3d(0.02, -0.1, 0.4));
  const Eigen::Vector3d t = -(scene.rotation * Eigen::Vector3d(0.2, 0.05, 0));
  scene.a.image = ImageIndex(4);
  scene.b.image = ImageIndex(9);
  const auto add = [](ImageFeatures& f, const Eigen::Vector2d& pixel, const SiftDescriptor& d) {
    f.keypoints.push_back({to_fixed_pixel(pixel.x()), to_fixed_pixel(pixel.y()), 4, 0});
    f.descriptors.push_back(d);
  };
  const auto random_pixel = [&] { return Eigen::Vector2d(2000 * unit(generator), 1500 * unit(generator)); };
  while (scene.a.keypoints.size() < kMatches) {
    const Eigen::Vector3d x =
        (0.7 + 0.6 * unit(generator)) * Eigen::Vector3d(unit(generator) * 1.4 - 0.7, unit(generator) - 0.5, 1);
    const Eigen::Vector3d in_b = scene.rotation * x + t;
    const Eigen::Vector2d pixel_a = project(camera.intrinsics, x), pixel_b = project(camera.intrinsics, in_b);
    if (pixel_b.x() < 0 || pixel_b.x() > 2000 || pixel_b.y() < 0 || pixel_b.y() > 1500) continue;
    SiftDescriptor d = random_descriptor(generator);
    add(scene.a, pixel_a, d);
    for (auto& v : d) v = static_cast<std::uint8_t>(v + generator() % 11);
    add(scene.b, pixel_b, d);
  }
  for (std::size_t i = 0; i < 100; ++i) {
    const SiftDescriptor d = random_descriptor(generator);
    for (ImageFeatures* f : {&scene.a, &scene.b}) {
      f->keypoints.push_back(f->keypoints[i]);
      f->keypoints.back().angle_deg = 90;
      f->descriptors.push_back(d);
    }
  }
  for (int i = 0; i < kOthers; ++i) {
    add(scene.a, random_pixel(), random_descriptor(generator));
    add(scene.b, random_pixel(), random_descriptor(generator));
  }
  for (int i = 0; i < 100; ++i) {  // wrong matches: the same descriptor anywhere
    const SiftDescriptor d = random_descriptor(generator);
    add(scene.a, random_pixel(), d);
    add(scene.b, random_pixel(), d);
  }
  return scene;
}

TEST(MatchPair, FindsOrientationAndInliers) {
  const TwoPictures scene = make_scene();
  const VerifiedPair pair = match_pair(scene.a, scene.b, make_camera(), make_camera(), {});
  EXPECT_EQ(pair.a, ImageIndex(4));
  EXPECT_EQ(pair.b, ImageIndex(9));
  EXPECT_EQ(pair.model, PairModel::kEssential);
  EXPECT_EQ(pair.putative, kMatches + 200);
  const Eigen::Quaterniond found(pair.rotation_wxyz[0], pair.rotation_wxyz[1], pair.rotation_wxyz[2],
                                 pair.rotation_wxyz[3]);
  EXPECT_LT(rotation_angle(found, scene.rotation), 1e-4);
  ASSERT_EQ(pair.feature_a.size(), pair.feature_b.size());
  EXPECT_TRUE(std::is_sorted(pair.feature_a.begin(), pair.feature_a.end()));
  int matched = 0, wrong = 0;
  for (std::size_t i = 0; i < pair.feature_a.size(); ++i) {
    EXPECT_FALSE(pair.feature_a[i] >= kMatches && pair.feature_a[i] < kMatches + 100) << "one place counted twice";
    (pair.feature_a[i] == pair.feature_b[i] && pair.feature_a[i] < kMatches ? matched : wrong) += 1;
  }
  EXPECT_EQ(matched, kMatches);
  EXPECT_LT(wrong, 5);
}

TEST(MatchPair, NamesTheFirstOfTheRowsAtOnePlace) {
  TwoPictures scene = make_scene();
  std::mt19937_64 generator(11);
  for (ImageFeatures* f : {&scene.a, &scene.b}) {  // row 0 is row 1 with another orientation, which nothing matches
    f->keypoints[0] = f->keypoints[1];
    f->descriptors[0] = random_descriptor(generator);
  }
  const VerifiedPair pair = match_pair(scene.a, scene.b, make_camera(), make_camera(), {});
  ASSERT_GT(pair.feature_a.size(), 2u);
  EXPECT_EQ(std::pair(pair.feature_a[0], pair.feature_b[0]), std::pair(0, 0));
  EXPECT_EQ(std::pair(pair.feature_a[1], pair.feature_b[1]), std::pair(2, 2));
}

// The two images with features that are turned as they should be, and their verticals. The second vertical is off by a
// given angle in its image.
struct UprightPictures {
  TwoPictures scene = make_scene();
  AxisDirection down_a, down_b;
  std::vector<std::int8_t> sectors_a, sectors_b;

  explicit UprightPictures(double off_deg) {
    std::mt19937_64 generator(13);
    const double turn_deg = 0.4 / kDegree;  // of the second image
    for (std::size_t i = 0; i < scene.a.keypoints.size(); ++i) {
      scene.a.keypoints[i].angle_deg = static_cast<float>(generator() % 360);
      const bool matched = i < kMatches + 100;
      scene.b.keypoints[i].angle_deg = static_cast<float>(
          std::fmod(matched ? scene.a.keypoints[i].angle_deg + turn_deg : static_cast<double>(generator() % 360), 360));
    }
    down_a.direction = Eigen::Vector3d::UnitY();
    down_b.direction =
        rotation_exp<double>(Eigen::Vector3d(0, 0, off_deg * kDegree)) * (scene.rotation * Eigen::Vector3d::UnitY());
    down_a.covariance = down_b.covariance = std::pow(0.1 * kDegree, 2) * Eigen::Matrix3d::Identity();
    sectors_a = upright_sectors(scene.a, make_camera(), down_a.direction);
    sectors_b = upright_sectors(scene.b, make_camera(), down_b.direction);
  }
  PairKnowledge knowledge() const {
    return {.orientation = std::nullopt,
            .vertical_a = down_a,
            .vertical_b = down_b,
            .upright_a = &sectors_a,
            .upright_b = &sectors_b};
  }
  Standing standing() const { return standing_of_coarsest(scene.a, scene.b, sectors_a, sectors_b, {}); }
};

TEST(MatchPair, TrueVerticalsCostNoMatches) {
  const UprightPictures upright(0);
  EXPECT_EQ(upright.standing(), Standing::kAlike);
  const VerifiedPair pair =
      match_pair(upright.scene.a, upright.scene.b, make_camera(), make_camera(), {}, upright.knowledge());
  EXPECT_LT(pair.putative, kMatches + 180) << "some of the wrong ones stand otherwise";
  EXPECT_GE(std::ssize(pair.feature_a), kMatches);
}

// If the sectors are off by less than two, some right features are still compared, and the rotation reveals the error.
TEST(MatchPair, WrongVerticalsCostNoMatches) {
  const TwoPictures plain = make_scene();
  const VerifiedPair without = match_pair(plain.a, plain.b, make_camera(), make_camera(), {});
  for (const double off : {25., -40., 70., 180.}) {
    const UprightPictures upright(off);
    EXPECT_EQ(upright.standing(), std::abs(off) < 30 ? Standing::kAlike : Standing::kTurned) << off;
    if (std::abs(off) > 45) continue;  // no right features are compared
    const VerifiedPair pair =
        match_pair(upright.scene.a, upright.scene.b, make_camera(), make_camera(), {}, upright.knowledge());
    EXPECT_EQ(pair.feature_a, without.feature_a) << off;
    EXPECT_EQ(pair.feature_b, without.feature_b) << off;
  }
}

// Without verticals, the turn of the images is used: matches of another turn are not compared, all right ones are.
TEST(MatchPair, TheTurnCostsNoMatches) {
  const UprightPictures turned(0);
  const auto match = [&](bool by_turn) {
    MatchOptions options;
    options.by_turn = by_turn;
    return match_pair(turned.scene.a, turned.scene.b, make_camera(), make_camera(), options);
  };
  const VerifiedPair with = match(true), without = match(false);
  EXPECT_EQ(without.putative, kMatches + 200);
  EXPECT_LT(with.putative, kMatches + 150);
  EXPECT_GE(with.putative, kMatches + 100);
  EXPECT_GE(std::ssize(with.feature_a), kMatches);
  EXPECT_LE(std::ssize(with.feature_a), std::ssize(without.feature_a));
}

TEST(MatchPair, IsRepeatable) {
  const TwoPictures scene = make_scene();
  const VerifiedPair first = match_pair(scene.a, scene.b, make_camera(), make_camera(), {});
  const VerifiedPair second = match_pair(scene.a, scene.b, make_camera(), make_camera(), {});
  EXPECT_EQ(first.feature_a, second.feature_a);
  EXPECT_EQ(first.rotation_wxyz, second.rotation_wxyz);
  EXPECT_EQ(first.translation, second.translation);
}

TEST(MatchPair, UnrelatedImagesAreNotVerified) {
  TwoPictures scene = make_scene();
  std::mt19937_64 generator(8);
  for (auto& d : scene.b.descriptors) d = random_descriptor(generator);
  for (auto& keypoint : scene.b.keypoints) keypoint.angle_deg = static_cast<float>(generator() % 360);
  MatchOptions all;
  all.by_turn = false;
  const VerifiedPair pair = match_pair(scene.a, scene.b, make_camera(), make_camera(), {});
  EXPECT_EQ(pair.model, PairModel::kNone);
  EXPECT_TRUE(pair.feature_a.empty());
  EXPECT_EQ(pair.putative, match_pair(scene.a, scene.b, make_camera(), make_camera(), all).putative)
      << "not taken for turned";
}

TEST(MatchPair, ImagesWithoutFeaturesAreNotVerified) {
  const TwoPictures scene = make_scene();
  ImageFeatures empty;
  empty.image = ImageIndex(20);
  EXPECT_EQ(match_pair(scene.a, empty, make_camera(), make_camera(), {}).model, PairModel::kNone);
}

// A facade 10 m away with identical windows: every feature has a twin in each other window, at multiples of 3.4 m.
TwoPictures make_facade(TrustedPair& pair) {
  std::mt19937_64 generator(5);
  std::uniform_real_distribution<double> unit(0, 1);
  TwoPictures scene;
  scene.a.image = ImageIndex(1);
  scene.b.image = ImageIndex(2);
  pair.b.centre = {1.2, 0.05, 0.1};
  pair.b.rotation = rotation_exp<double>(Eigen::Vector3d(0.01, -0.02, 0.005));
  pair.position_sigma_m = 0.02;
  pair.rotation_sigma_rad = 5e-4;
  const Camera camera = make_camera();
  const auto add = [](ImageFeatures& f, const Eigen::Vector2d& pixel, const SiftDescriptor& d) {
    f.keypoints.push_back({to_fixed_pixel(pixel.x()), to_fixed_pixel(pixel.y()), 4, 0});
    f.descriptors.push_back(d);
  };
  const auto worn = [&](SiftDescriptor d) {
    for (auto& v : d) v = static_cast<std::uint8_t>(v + generator() % 9);
    return d;
  };
  for (int i = 0; i < 80; ++i) {
    const SiftDescriptor d = random_descriptor(generator);
    const Eigen::Vector3d place(3.4 * unit(generator), 3 * unit(generator) - 1.5, 10 + 0.4 * unit(generator));
    for (int window = -1; window < 2; ++window) {
      const Eigen::Vector3d x = place + Eigen::Vector3d(3.4 * window - 1.7, 0, 0);
      const Eigen::Vector2d in_a = project(camera.intrinsics, x),
                            in_b = project(camera.intrinsics, to_inside(pair.b, x));
      if (in_a.x() < 0 || in_a.x() > 2000 || in_b.x() < 0 || in_b.x() > 2000) continue;
      scene.true_matches.emplace_back(std::ssize(scene.a.keypoints), std::ssize(scene.b.keypoints));
      add(scene.a, in_a, worn(d));
      add(scene.b, in_b, worn(d));
    }
  }
  return scene;
}

TEST(MatchPair, TrustedOrientationTellsRepeatedWindowsApart) {
  TrustedPair pair;
  const TwoPictures scene = make_facade(pair);
  const auto right = [&](const VerifiedPair& found) {
    std::size_t count = 0;
    for (std::size_t i = 0; i < found.feature_a.size(); ++i)
      count += std::find(scene.true_matches.begin(), scene.true_matches.end(),
                         std::pair(found.feature_a[i], found.feature_b[i])) != scene.true_matches.end();
    return count;
  };
  ASSERT_GT(scene.true_matches.size(), 150u);
  MatchOptions options;
  options.guided = true;
  options.min_distance_m = 4;
  const VerifiedPair guided = match_pair(scene.a, scene.b, make_camera(), make_camera(), options, {pair, nullptr});
  EXPECT_GE(right(guided), scene.true_matches.size() * 95 / 100);
  EXPECT_LE(guided.feature_a.size() - right(guided), guided.feature_a.size() / 50);
  options.guided = false;
  const VerifiedPair blind = match_pair(scene.a, scene.b, make_camera(), make_camera(), options, {pair, nullptr});
  EXPECT_LT(right(blind), right(guided) / 2);
}

// If the trust is misplaced, the pair is matched as if there were none.
TEST(MatchPair, AWrongTrustIsNoHarm) {
  const TwoPictures scene = make_scene();
  TrustedPair wrong;
  wrong.b = {rotation_exp<double>(Eigen::Vector3d(0.3, 0.2, -0.5)), {-1, 2, 0.5}};
  wrong.rotation_sigma_rad = 1e-3;
  MatchOptions options;
  options.guided = true;
  const VerifiedPair pair = match_pair(scene.a, scene.b, make_camera(), make_camera(), options, {wrong, nullptr});
  EXPECT_EQ(pair.feature_a, match_pair(scene.a, scene.b, make_camera(), make_camera(), {}).feature_a);
  EXPECT_FALSE(pair.feature_a.empty());
}

TEST(MatchPair, BadInputIsRefused) {
  const TwoPictures scene = make_scene();
  EXPECT_THROW(match_pair(scene.b, scene.a, make_camera(), make_camera(), {}), InputError);
  MatchOptions options;
  options.ratio = 1.5;
  EXPECT_THROW(match_pair(scene.a, scene.b, make_camera(), make_camera(), options), InputError);
}

}  // namespace
}  // namespace megablock
