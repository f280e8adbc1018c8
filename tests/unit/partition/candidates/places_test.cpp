// Places of registration in simulated drives: every crossing and every parallel pass, but not a bridge over a street.
#include "partition/candidates/places.h"

#include <gtest/gtest.h>

#include <random>
#include <set>

namespace megablock {
namespace {

struct Drives {
  std::vector<Eigen::Vector3d> positions;
  std::vector<std::int64_t> pass;
  void add(std::int64_t number, const Eigen::Vector3d& from, const Eigen::Vector3d& to, double step = 4) {
    const auto count = static_cast<int>((to - from).norm() / step);
    for (int i = 0; i <= count; ++i) {
      const Eigen::Vector3d noise(normal(random), normal(random), 0.3 * normal(random));
      positions.push_back(from + (to - from) * (static_cast<double>(i) / count) + 0.1 * noise);
      pass.push_back(number);
    }
  }
  std::vector<Place> places(const PlaceOptions& options = {}) const {
    return choose_places(positions, pass, panorama_graph(positions, options), options);
  }
  std::mt19937_64 random{4};
  std::normal_distribution<double> normal{0, 1};
};

TEST(PanoramaGraph, ALonePassHasBorderEdgesOnly) {
  Drives drives;
  drives.add(0, {0, 0, 30}, {400, 0, 32});
  const auto edges = panorama_graph(drives.positions, {});
  std::set<std::pair<std::int64_t, std::int64_t>> successive;
  for (const PanoramaEdge& edge : edges)
    if (edge.b == edge.a + 1) successive.insert({edge.a, edge.b});
  EXPECT_EQ(successive.size(), drives.positions.size() - 1) << "succession along the pass";
  EXPECT_TRUE(drives.places().empty());
}

TEST(PanoramaGraph, ABridgeIsNotJoinedWithTheStreetBelow) {
  Drives drives;
  drives.add(0, {-200, 0, 36}, {200, 0, 36});
  drives.add(1, {0, -200, 30}, {0, 200, 30});
  const auto below = static_cast<std::int64_t>(std::count(drives.pass.begin(), drives.pass.end(), 0));
  for (const PanoramaEdge& edge : panorama_graph(drives.positions, {}))
    EXPECT_FALSE(edge.a < below && edge.b >= below) << edge.a << " " << edge.b;
  EXPECT_TRUE(drives.places().empty());
}

TEST(Places, EveryCrossingAndEveryParallelPass) {
  Drives drives;
  constexpr int kStreets = 5;
  for (int s = 0; s < kStreets; ++s) drives.add(0, {-20, 100.0 * s, 30}, {420, 100.0 * s, 30});
  for (int s = 0; s < kStreets; ++s) drives.add(1, {100.0 * s, -20, 30.5}, {100.0 * s, 420, 30.5});
  for (int s = 0; s < kStreets; ++s) drives.add(2, {420, 100.0 * s + 3, 30}, {-20, 100.0 * s + 3, 30});
  // A trajectory that drifts in every pass.
  for (std::size_t i = 0; i < drives.positions.size(); ++i)
    drives.positions[i] += Eigen::Vector3d(0.8, -0.7, 0.2) * static_cast<double>(drives.pass[i]);
  const std::vector<Place> places = drives.places();
  std::set<std::tuple<int, int, std::int64_t>> crossings;  // with each of the two passes along x
  std::int64_t along = 0;
  for (const Place& place : places) {
    const auto a = static_cast<std::size_t>(place.a.value), c = static_cast<std::size_t>(place.c.value);
    EXPECT_LT((drives.positions[a] - drives.positions[c]).norm(), 20);
    EXPECT_EQ(drives.pass[a], drives.pass[static_cast<std::size_t>(place.b.value)]);
    EXPECT_EQ(drives.pass[c], drives.pass[static_cast<std::size_t>(place.d.value)]);
    EXPECT_EQ(std::abs(place.a.value - place.b.value), 1);
    const Eigen::Vector3d& p = drives.positions[a];
    if (drives.pass[a] == 1 || drives.pass[c] == 1)
      crossings.insert({static_cast<int>(std::lround(p.x() / 100)), static_cast<int>(std::lround(p.y() / 100)),
                        drives.pass[a] == 1 ? drives.pass[c] : drives.pass[a]});
    else
      ++along;
  }
  EXPECT_EQ(crossings.size(), 2u * kStreets * kStreets);
  // Five streets of 110 frames: a registration every 15 frames, and where stretches of either visit end.
  EXPECT_GE(along, kStreets * 110 / 15);
  EXPECT_LE(along, 3 * kStreets * 110 / 15);
  PlaceOptions sparse;
  sparse.registration_spacing = 30;
  EXPECT_LT(drives.places(sparse).size(), places.size());
}

TEST(Places, ADriveThatComesBackMeetsItself) {
  Drives drives;
  drives.add(0, {0, 0, 30}, {200, 0, 30});
  drives.add(0, {200, 4, 30}, {0, 4, 30});
  const std::vector<Place> places = drives.places();
  ASSERT_FALSE(places.empty());
  for (const Place& place : places) EXPECT_GT(place.c.value - place.a.value, 25);
}

TEST(Places, RepeatedAndFewPositions) {
  EXPECT_TRUE(panorama_graph({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {}).empty());
  Drives drives;
  drives.add(0, {0, 0, 30}, {100, 0, 30});
  drives.positions.push_back(drives.positions[3]);
  drives.pass.push_back(0);
  EXPECT_FALSE(panorama_graph(drives.positions, {}).empty());
}

}  // namespace
}  // namespace megablock
