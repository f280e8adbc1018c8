// The three-point solver with known verticals: the truth of simulated pairs, tilted images, and degenerate cases.
#include "geometry/two_view/vertical_pair.h"

#include <gtest/gtest.h>

#include "tests/support/geometry/pair_scene.h"

namespace megablock {
namespace {

using ThreeRays = std::array<Eigen::Vector3d, 3>;
const Eigen::Vector3d kDown = Eigen::Vector3d::UnitY();

TEST(VerticalPair, FindsAnyOrientationOfTiltedImages) {
  std::mt19937_64 random(2);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (int trial = 0; trial < 500; ++trial) {
    PairSceneOptions options;
    options.rotation = rotation_exp<double>(3.1 * uniform(random) * random_direction(random));
    options.base = 0.3 * random_direction(random);
    const PairScene scene(options, 3, random);
    const Eigen::Vector3d vertical = random_direction(random);  // any direction will do
    const auto found =
        solve_vertical_pair(scene.first<3>(scene.a), scene.first<3>(scene.b), vertical, options.rotation * vertical);
    EXPECT_LT(nearest_error_deg(found, scene.truth), 1e-5);
    for (const RelativeOrientation& o : found) {
      EXPECT_LT((o.rotation * vertical - options.rotation * vertical).norm(), 1e-12);
      for (std::size_t i = 0; i < 3; ++i) EXPECT_LT(std::abs(scene.b[i].dot(essential_from(o) * scene.a[i])), 1e-10);
      EXPECT_TRUE(all_in_front(o, scene.first<3>(scene.a), scene.first<3>(scene.b)));
    }
  }
}

TEST(VerticalPair, ThreePointsOnOneLineAreEnough) {
  PairSceneOptions options;
  options.rotation = Eigen::AngleAxisd(0.4, kDown);
  ThreeRays a, b;
  for (std::size_t i = 0; i < 3; ++i) {
    const Eigen::Vector3d point(-0.4 + 0.3 * static_cast<double>(i), 0.1 + 0.2 * static_cast<double>(i), 2);
    a[i] = point.normalized();
    b[i] = (options.rotation * point + options.base).normalized();
  }
  const RelativeOrientation truth{options.rotation, options.base.normalized()};
  EXPECT_LT(nearest_error_deg(solve_vertical_pair(a, b, kDown, kDown), truth), 1e-6);
}

TEST(VerticalPair, PlaneSeenAlongItsNormalIsADoubleRoot) {
  std::mt19937_64 random(4);
  for (int trial = 0; trial < 200; ++trial) {
    PairSceneOptions options;
    options.base = {0, 0, 0.3};
    options.plane = true;
    const PairScene scene(options, 3, random);
    const auto found = solve_vertical_pair(scene.first<3>(scene.a), scene.first<3>(scene.b), kDown, kDown);
    EXPECT_LT(nearest_error_deg(found, scene.truth), 1e-2);
  }
}

// Any base in the plane fits, so only this can be tested: every result is an orientation that fulfils the equations.
// With points off the plane by a hundredth, the truth is found.
TEST(VerticalPair, PointsAndBaseInOnePlane) {
  std::mt19937_64 random(6);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::size_t in_plane = 0;
  for (int trial = 0; trial < 1000; ++trial)
    for (const double off : {0.0, 0.01}) {
      const RelativeOrientation truth{rotation_exp<double>(0.5 * uniform(random) * random_direction(random)),
                                      random_direction(random)};
      const Eigen::Vector3d vertical = random_direction(random), centre_b = truth.rotation.conjugate() * -truth.base;
      const Eigen::Vector3d ahead(0.3 * uniform(random), 0.3 * uniform(random), 6);
      const Eigen::Vector3d normal = ahead.cross(centre_b).normalized();
      ThreeRays a, b;
      for (std::size_t i = 0; i < 3; ++i) {
        const double depth = 1 + 0.3 * uniform(random), across = 5 * uniform(random);
        const Eigen::Vector3d point = depth * ahead + across * centre_b + 6 * off * uniform(random) * normal;
        a[i] = point.normalized();
        b[i] = (truth.rotation * point + truth.base).normalized();
      }
      const auto found = solve_vertical_pair(a, b, vertical, truth.rotation * vertical);
      if (off == 0) in_plane += found.size();
      for (const RelativeOrientation& o : found) {
        EXPECT_NEAR(o.rotation.norm(), 1, 1e-12);
        EXPECT_NEAR(o.base.norm(), 1, 1e-12);
        EXPECT_LT((o.rotation * vertical - truth.rotation * vertical).norm(), 1e-12);
        EXPECT_TRUE(all_in_front(o, a, b));
        for (std::size_t i = 0; i < 3; ++i) EXPECT_LT(std::abs(b[i].dot(essential_from(o) * a[i])), 1e-6 + 1e-12);
      }
      if (off > 0) {
        EXPECT_LT(nearest_error_deg(found, truth), 1e-3);
      }
    }
  EXPECT_GT(in_plane, 0u);
}

TEST(VerticalPair, NothingForBadPoints) {
  std::mt19937_64 random(3);
  const PairScene scene({}, 3, random);
  const ThreeRays a = scene.first<3>(scene.a), b = scene.first<3>(scene.b);
  ThreeRays bad = a;
  bad[1].x() = std::nan("");
  EXPECT_TRUE(solve_vertical_pair(bad, b, kDown, kDown).empty());
  EXPECT_TRUE(solve_vertical_pair(a, b, Eigen::Vector3d::Constant(std::nan("")), kDown).empty());
  bad = a;
  bad[2] = bad[0];
  EXPECT_TRUE(solve_vertical_pair(bad, b, kDown, kDown).empty()) << "two points are one";
  EXPECT_TRUE(solve_vertical_pair(a, a, kDown, kDown).empty()) << "no base";
}

// A ray turned around fulfils all equations, too. Only orientations that see its point in front remain.
TEST(VerticalPair, PointsBehindAreNotMet) {
  std::mt19937_64 random(5);
  std::size_t found = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const PairScene scene({}, 3, random);
    const ThreeRays a = scene.first<3>(scene.a), b = scene.first<3>(scene.b);
    ThreeRays behind = b;
    behind[0] = -behind[0];
    EXPECT_LT(nearest_error_deg(solve_vertical_pair(a, b, kDown, kDown), scene.truth), 1e-5);
    const auto others = solve_vertical_pair(a, behind, kDown, kDown);
    EXPECT_GT(nearest_error_deg(others, scene.truth), 1e-3);
    for (const RelativeOrientation& o : others) EXPECT_TRUE(all_in_front(o, a, behind));
    found += others.size();
  }
  EXPECT_GT(found, 0u);
}

}  // namespace
}  // namespace megablock
