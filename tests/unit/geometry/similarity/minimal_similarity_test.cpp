// Minimal solutions of a similarity, from three points and from mixed control, against the simulated truth.
#include "geometry/similarity/minimal_similarity.h"

#include <gtest/gtest.h>

#include "geometry/similarity/minimal_control.h"
#include "tests/support/geometry/pair_scene.h"

namespace megablock {
namespace {

using Triangle = std::array<Eigen::Vector3d, 3>;

Similarity random_similarity(std::mt19937_64& random) {
  std::uniform_real_distribution<double> uniform(0, 1);
  return {0.2 + 3 * uniform(random), rotation_exp<double>(3.14 * uniform(random) * random_direction(random)),
          1000 * random_direction(random)};
}

double largest_difference(const Similarity& a, const Similarity& b) {
  return std::max({std::abs(a.scale / b.scale - 1), rotation_angle(a.rotation, b.rotation),
                   (a.translation - b.translation).norm() / b.translation.norm()});
}

TEST(MinimalSimilarity, IsExactForAnyRotation) {
  std::mt19937_64 random(41);
  for (int trial = 0; trial < 1000; ++trial) {
    Similarity truth = random_similarity(random);
    if (trial % 10 == 0) truth.rotation = rotation_exp<double>(std::numbers::pi * random_direction(random));
    if (trial % 10 == 1) truth.rotation = rotation_exp<double>(std::numbers::pi * Eigen::Vector3d::Unit(trial % 3));
    Triangle from, to;
    for (std::size_t i = 0; i < 3; ++i) {
      from[i] = 50 * random_direction(random);
      to[i] = truth(from[i]);
    }
    const auto found = solve_similarity(from, to);
    ASSERT_TRUE(found);
    EXPECT_LT(largest_difference(*found, truth), 1e-8);
    // The order of the points must not matter.
    const auto turned = solve_similarity({from[1], from[2], from[0]}, {to[1], to[2], to[0]});
    EXPECT_LT(largest_difference(*found, *turned), 1e-8);
  }
}

TEST(MinimalSimilarity, NothingForBadPoints) {
  const Triangle good = {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(5, 1, 0), Eigen::Vector3d(1, 4, 2)};
  const Triangle line = {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(1, 1, 0), Eigen::Vector3d(3, 3, 0)};
  Triangle twice = good, bad = good;
  twice[2] = twice[0];
  bad[1].x() = std::nan("");
  for (const Triangle& other : {line, twice, bad}) {
    EXPECT_FALSE(solve_similarity(good, other));
    EXPECT_FALSE(solve_similarity(other, good));
  }
}

// The smallest difference of a solution from the truth. Every solution must meet the control.
template <std::size_t Places, typename Heights>
double nearest_of(const Solutions<Similarity, 2>& found, const Similarity& truth,
                  const std::array<PlaceControl, Places>& places, const Heights& heights) {
  double nearest = 1e9;
  for (const Similarity& s : found) {
    nearest = std::min(nearest, largest_difference(s, truth));
    for (const PlaceControl& p : places) EXPECT_LT((s(p.model).head<2>() - p.ground).norm(), 1e-7);
    for (const HeightControl& h : heights) EXPECT_LT(std::abs(s(h.model).z() - h.ground), 1e-7);
  }
  return nearest;
}

TEST(MinimalControl, TwoPlacesAndThreeHeights) {
  std::mt19937_64 random(42);
  for (int trial = 0; trial < 500; ++trial) {
    const Similarity truth = random_similarity(random);
    std::array<Eigen::Vector3d, 5> x;
    for (Eigen::Vector3d& point : x) point = 50 * random_direction(random);
    const bool full = trial % 2;  // the heights of the two planimetric points and of one more point
    std::array<PlaceControl, 2> places;
    for (std::size_t i = 0; i < 2; ++i) places[i] = {x[i], truth(x[i]).head<2>()};
    std::array<HeightControl, 3> heights;
    for (std::size_t i = 0; i < 3; ++i) {
      const Eigen::Vector3d& point = full ? x[i] : x[i + 2];
      heights[i] = {point, truth(point).z()};
    }
    const auto found = solve_minimal_control(places, heights);
    EXPECT_LT(nearest_of(found, truth, places, heights), 1e-6);
  }
}

TEST(MinimalControl, ThreePlacesAndOneHeight) {
  std::mt19937_64 random(43);
  for (int trial = 0; trial < 500; ++trial) {
    const Similarity truth = random_similarity(random);
    std::array<PlaceControl, 3> places;
    for (PlaceControl& place : places) {
      place.model = 50 * random_direction(random);
      place.ground = truth(place.model).head<2>();
    }
    const Eigen::Vector3d x = 50 * random_direction(random);
    const std::array<HeightControl, 1> heights = {HeightControl{x, truth(x).z()}};
    const auto found = solve_minimal_control(places, heights[0]);
    EXPECT_LT(nearest_of(found, truth, places, heights), 1e-6);
  }
}

TEST(MinimalControl, NothingForBadControl) {
  const Eigen::Vector3d o(0, 0, 0), x(10, 0, 0), y(0, 10, 0);
  const std::array<PlaceControl, 2> places = {PlaceControl{o, {0, 0}}, PlaceControl{x, {10, 0}}};
  EXPECT_TRUE(
      solve_minimal_control(places, {HeightControl{o, 0}, HeightControl{x, 0}, HeightControl{2 * x, 0}}).empty())
      << "heights on one line";
  EXPECT_TRUE(
      solve_minimal_control({places[0], places[0]}, {HeightControl{o, 0}, HeightControl{x, 0}, HeightControl{y, 0}})
          .empty())
      << "one place twice";
  EXPECT_TRUE(solve_minimal_control({PlaceControl{o, {0, 0}}, PlaceControl{{0, 0, 5}, {10, 0}}},
                                    {HeightControl{o, 0}, HeightControl{x, 0}, HeightControl{y, 0}})
                  .empty())
      << "places along the normal";
  EXPECT_TRUE(solve_minimal_control(places, {HeightControl{o, 0}, HeightControl{x, std::nan("")}, HeightControl{y, 0}})
                  .empty());
  EXPECT_TRUE(solve_minimal_control({places[0], places[1], PlaceControl{2 * x, {20, 0}}}, {o, 0}).empty())
      << "places on one line";
}

TEST(MinimalControl, NothingForControlThatIsNoNumberOrThereTwice) {
  const double nan = std::nan("");
  const Eigen::Vector3d o(0, 0, 0), x(10, 0, 1), y(0, 10, 2), z(4, 5, 9);
  using Places = std::array<PlaceControl, 3>;
  using Heights = std::array<HeightControl, 3>;
  const Places places = {PlaceControl{o, {0, 0}}, PlaceControl{x, {10, 0}}, PlaceControl{y, {0, 10}}};
  const Heights heights = {HeightControl{o, 0}, HeightControl{x, 1}, HeightControl{y, 2}};
  const auto by_heights = [](const Places& p, const Heights& h) { return solve_minimal_control({p[0], p[1]}, h); };
  const HeightControl one{z, 9};
  ASSERT_FALSE(by_heights(places, heights).empty());
  ASSERT_FALSE(solve_minimal_control(places, one).empty());
  for (std::size_t i = 0; i < 3; ++i) {
    Places bad = places;
    bad[i].model.z() = nan;
    EXPECT_EQ(by_heights(bad, heights).empty(), i < 2) << i;  // the third does not enter
    EXPECT_TRUE(solve_minimal_control(bad, one).empty()) << i;
    bad = places;
    bad[i].ground.y() = nan;
    EXPECT_EQ(by_heights(bad, heights).empty(), i < 2) << i;
    EXPECT_TRUE(solve_minimal_control(bad, one).empty()) << i;
    bad = places;
    bad[i] = bad[(i + 1) % 3];
    EXPECT_TRUE(solve_minimal_control(bad, one).empty()) << "one place twice, " << i;
    bad[i].ground += Eigen::Vector2d(3, 1);
    EXPECT_TRUE(solve_minimal_control(bad, one).empty()) << "with two grounds, " << i;
    Heights bad_heights = heights;
    bad_heights[i].model.x() = nan;
    EXPECT_TRUE(by_heights(places, bad_heights).empty()) << i;
    bad_heights = heights;
    bad_heights[i].ground = nan;
    EXPECT_TRUE(by_heights(places, bad_heights).empty()) << i;
    bad_heights = heights;
    bad_heights[i] = bad_heights[(i + 1) % 3];
    EXPECT_TRUE(by_heights(places, bad_heights).empty()) << "one height twice, " << i;
  }
  EXPECT_TRUE(solve_minimal_control(places, {z, nan}).empty());
  EXPECT_TRUE(solve_minimal_control(places, {Eigen::Vector3d(0, nan, 0), 9}).empty());
  const Places one_place = {PlaceControl{o, {3, 3}}, PlaceControl{x, {3, 3}}, PlaceControl{y, {3, 3}}};
  EXPECT_TRUE(solve_minimal_control(one_place, one).empty()) << "all at one place of the ground";
  EXPECT_TRUE(by_heights(one_place, heights).empty()) << "all at one place of the ground";
}

}  // namespace
}  // namespace megablock
