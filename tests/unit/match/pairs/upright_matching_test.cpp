// Matching by sectors relative to the vertical: against all comparisons written out, and with wrong verticals.
#include "match/pairs/upright_matching.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "geometry/camera/camera.h"
#include "geometry/numbers/angles.h"
#include "geometry/transform/rotation.h"
#include "io/block/tracks.h"
#include "match/tracks/matched_features.h"

namespace megablock {
namespace {

constexpr std::size_t kNearest = 3;

std::vector<SiftDescriptor> random_descriptors(std::size_t count, std::mt19937_64& generator) {
  std::vector<SiftDescriptor> descriptors(count);
  for (auto& descriptor : descriptors)
    for (auto& value : descriptor) value = static_cast<std::uint8_t>(generator() % 4);  // with ties
  return descriptors;
}

std::vector<std::int8_t> random_sectors(std::size_t count, std::mt19937_64& generator) {
  std::vector<std::int8_t> sectors(count);
  for (auto& sector : sectors) sector = static_cast<std::int8_t>(static_cast<int>(generator() % 13) - 1);
  return sectors;
}

bool alike(std::int8_t a, std::int8_t b) {
  const int apart = std::abs(a - b);
  return a == kAnySector || b == kAnySector || apart <= 1 || apart == kUprightSectors - 1;
}

// All descriptors, one after the other.
void expect_nearest(const std::vector<SiftDescriptor>& of, const std::vector<SiftDescriptor>& among,
                    const std::vector<std::int8_t>& sectors_of, const std::vector<std::int8_t>& sectors_among,
                    const Neighbours& found) {
  ASSERT_EQ(found.row.size(), of.size() * kNearest);
  for (std::size_t i = 0; i < of.size(); ++i) {
    std::vector<std::pair<std::int32_t, std::int32_t>> all;
    for (std::size_t j = 0; j < among.size(); ++j) {
      if (!alike(sectors_of[i], sectors_among[j])) continue;
      std::int32_t distance = 0;
      for (std::size_t d = 0; d < of[i].size(); ++d) distance += (of[i][d] - among[j][d]) * (of[i][d] - among[j][d]);
      all.emplace_back(distance, static_cast<std::int32_t>(j));
    }
    std::sort(all.begin(), all.end());
    all.resize(kNearest, {Neighbours::kFar, -1});
    for (std::size_t n = 0; n < kNearest; ++n) {
      EXPECT_EQ(found.distance[i * kNearest + n], all[n].first) << i << " " << n;
      EXPECT_EQ(found.row[i * kNearest + n], all[n].second) << i << " " << n;
    }
  }
}

TEST(UprightMatching, IsThatOfAllThatStandAlike) {
  std::mt19937_64 generator(5);
  for (const auto& [count_a, count_b] : {std::pair<std::size_t, std::size_t>{300, 250}, {20, 3}, {5, 0}, {0, 7}}) {
    const auto a = random_descriptors(count_a, generator), b = random_descriptors(count_b, generator);
    const auto sectors_a = random_sectors(count_a, generator), sectors_b = random_sectors(count_b, generator);
    const MutualNeighbours found = nearest_alike(a, b, sectors_a, sectors_b, kNearest);
    expect_nearest(a, b, sectors_a, sectors_b, found.of_a);
    expect_nearest(b, a, sectors_b, sectors_a, found.of_b);
  }
}

TEST(UprightMatching, WithoutSectorsItIsThatOfAll) {
  std::mt19937_64 generator(6);
  const auto a = random_descriptors(90, generator), b = random_descriptors(70, generator);
  const std::vector<std::int8_t> any_a(90, kAnySector), any_b(70, kAnySector);
  const MutualNeighbours found = nearest_alike(a, b, any_a, any_b, kNearest), all = nearest_neighbours(a, b, kNearest);
  EXPECT_EQ(found.of_a.row, all.of_a.row);
  EXPECT_EQ(found.of_b.row, all.of_b.row);
  EXPECT_EQ(found.of_b.distance, all.of_b.distance);
}

Camera bent_camera() {
  Camera camera;
  camera.intrinsics = {1400, 1003, 748, -0.08, 0.01, 0, 0.001, -0.0005};
  return camera;
}

// Marks on walls, seen by rotated and tilted cameras: the direction of a mark on the wall, as seen in each image.
TEST(UprightMatching, MarksOfWallsKeepTheirSector) {
  const Camera camera = bent_camera();
  std::mt19937_64 generator(7);
  std::uniform_real_distribution<double> unit(-1, 1);
  const Eigen::Vector3d down = -Eigen::Vector3d::UnitZ();
  // Axes of a level camera that looks north (x right, y down, z ahead), then rolled and tilted.
  Eigen::Matrix3d level;
  level << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  const Eigen::Matrix3d a = rotation_exp<double>(Eigen::Vector3d(0.2, 0, 0.5)).toRotationMatrix() * level,
                        b = rotation_exp<double>(Eigen::Vector3d(-0.1, 0.15, -1.4)).toRotationMatrix() * level;
  ImageFeatures seen_a, seen_b;
  for (int i = 0; i < 400; ++i) {
    const Eigen::Vector3d place(3 * unit(generator), 10, 2 * unit(generator));
    const double turn = 3.14 * unit(generator);
    const Eigen::Vector3d mark(0.01 * std::cos(turn), 0, 0.01 * std::sin(turn));
    const auto see = [&](const Eigen::Matrix3d& rotation, const Eigen::Vector3d& centre, ImageFeatures& image) {
      const Eigen::Vector2d at = project(camera.intrinsics, rotation * (place - centre)),
                            to = project(camera.intrinsics, rotation * (place + mark - centre));
      const double angle = std::atan2(to.y() - at.y(), to.x() - at.x()) / kDegree;
      image.keypoints.push_back(
          {to_fixed_pixel(at.x()), to_fixed_pixel(at.y()), 4, static_cast<float>(angle < 0 ? angle + 360 : angle)});
    };
    see(a, {0, 0, 0}, seen_a);
    see(b, {1, 0.5, 0.3}, seen_b);
  }
  const auto sectors_a = upright_sectors(seen_a, camera, a * down),
             sectors_b = upright_sectors(seen_b, camera, b * down);
  for (std::size_t i = 0; i < sectors_a.size(); ++i) {
    EXPECT_NE(sectors_a[i], kAnySector);
    EXPECT_TRUE(alike(sectors_a[i], sectors_b[i])) << i;
  }
}

TEST(UprightMatching, LookingDownNothingStands) {
  ImageFeatures image;
  for (int i = 0; i < 50; ++i) image.keypoints.push_back({to_fixed_pixel(40. * i), to_fixed_pixel(700), 4, 10});
  for (const std::int8_t sector : upright_sectors(image, bent_camera(), Eigen::Vector3d::UnitZ()))
    EXPECT_EQ(sector, kAnySector);
}

// Matches of which `right` have this turn (degrees, accurate to 8), and the others any.
Standing standing(double turn_deg, int right, int wrong, std::uint64_t seed) {
  std::mt19937_64 generator(seed);
  std::uniform_real_distribution<double> any(0, 360);
  std::normal_distribution<double> error(0, 8);
  const auto sector = [](double degrees) {
    return static_cast<std::int8_t>(static_cast<int>(std::floor((degrees + 3600) / 30)) % kUprightSectors);
  };
  std::vector<std::int8_t> a, b;
  std::vector<std::pair<std::int32_t, std::int32_t>> matches;
  for (int i = 0; i < right + wrong; ++i) {
    const double of_a = any(generator);
    a.push_back(sector(of_a));
    b.push_back(sector(i < right ? of_a + turn_deg + error(generator) : any(generator)));
    matches.emplace_back(i, i);
  }
  return compare_standing(matches, a, b);
}

TEST(UprightMatching, WrongVerticalsAreNoticed) {
  int turned = 0, alike = 0, turned_by_chance = 0, missed = 0, not_noticed = 0;
  for (std::uint64_t seed = 1; seed <= 1000; ++seed) {
    turned_by_chance += standing(0, 60, 60, seed) == Standing::kTurned;
    missed += standing(0, 60, 60, seed) == Standing::kUnknown;
    EXPECT_EQ(standing(180, 60, 30, seed), Standing::kTurned);
    EXPECT_EQ(standing(-60, 60, 30, seed), Standing::kTurned);
    not_noticed += standing(40, 120, 60, seed) != Standing::kTurned;
    turned += standing(0, 0, 40, seed) == Standing::kTurned;
    alike += standing(0, 0, 40, seed) == Standing::kAlike;
  }
  EXPECT_LE(turned, 4);
  EXPECT_LE(alike, 4);
  EXPECT_LE(turned_by_chance, 1);
  EXPECT_LE(missed, 1);
  EXPECT_LE(not_noticed, 30) << "these are left to the rotation of the pair";
  EXPECT_EQ(standing(0, 0, 0, 1), Standing::kUnknown);
  EXPECT_EQ(standing(90, 5, 0, 1), Standing::kUnknown) << "too few to tell";
}

TEST(UprightMatching, ItTakesEvidenceToBelieveAVertical) {
  const auto pair = [](int a, int b, Standing standing) {
    return StandingPair{ImageIndex(a), ImageIndex(b), standing};
  };
  // Images 0 to 2 agree, 3 is turned against them, nothing is known of 4 and 5.
  const std::vector<StandingPair> pairs{pair(0, 1, Standing::kAlike),   pair(0, 2, Standing::kUnknown),
                                        pair(1, 2, Standing::kAlike),   pair(0, 3, Standing::kTurned),
                                        pair(1, 3, Standing::kTurned),  pair(2, 3, Standing::kUnknown),
                                        pair(0, 4, Standing::kUnknown), pair(4, 5, Standing::kUnknown)};
  // 0 and 1 are turned against 3 as often as they agree with others.
  EXPECT_EQ(upright_pairs(pairs), (std::vector<std::uint8_t>{1, 0, 1, 0, 0, 0, 0, 0}));
  std::vector<StandingPair> more = pairs;
  for (const int image : {0, 1, 2}) more.push_back(pair(image, 6, Standing::kAlike));
  EXPECT_EQ(upright_pairs(more), (std::vector<std::uint8_t>{1, 1, 1, 0, 0, 0, 0, 0, 1, 1, 1}));
  EXPECT_TRUE(upright_pairs({}).empty());
}

}  // namespace
}  // namespace megablock
