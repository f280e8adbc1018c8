// The three-point problem: the true pose of simulated cameras is among the solutions, also in special positions, and
// every solution meets the points.
#include "geometry/resection/p3p.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>
#include <random>
#include <vector>

#include "geometry/numbers/median.h"

namespace megablock {
namespace {

TEST(P3p, FindsTheTruthAmongConsistentSolutions) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal(0, 1);
  const auto vector = [&] { return Eigen::Vector3d(normal(random), normal(random), normal(random)); };
  int missed = 0;
  constexpr int kTrials = 2000;
  for (int trial = 0; trial < kTrials; ++trial) {
    const Pose truth{rotation_exp<double>(2 * vector()), 1000 * vector()};
    std::array<Eigen::Vector3d, 3> rays, points;
    for (std::size_t k = 0; k < 3; ++k) {
      const Eigen::Vector3d inside(3 * normal(random), 2 * normal(random), 10 + 2 * std::abs(normal(random)));
      rays[k] = inside.normalized();
      points[k] = truth.centre + truth.rotation.conjugate() * inside;
    }
    const auto poses = solve_p3p(rays, points);
    double nearest = 1e9;
    for (const Pose& pose : poses) {
      for (std::size_t k = 0; k < 3; ++k)
        EXPECT_LT((to_inside(pose, points[k]).normalized() - rays[k]).norm(), 1e-6) << "every solution meets the rays";
      nearest = std::min(nearest, (pose.centre - truth.centre).norm() + rotation_angle(pose.rotation, truth.rotation));
    }
    missed += !(nearest < 1e-5);
  }
  EXPECT_LE(missed, kTrials / 200) << "near-degenerate triangles only";
}

// For a camera on the axis of an equilateral triangle, two of the conics are pairs of lines themselves.
TEST(P3p, FromTheAxisOfAnEquilateralTriangle) {
  for (const double height : {0.5, 2.0, 30.0, 1000.0}) {
    std::array<Eigen::Vector3d, 3> rays, points;
    for (std::size_t k = 0; k < 3; ++k) {
      const double angle = 2 * std::numbers::pi / 3 * static_cast<double>(k);
      points[k] = {std::cos(angle), std::sin(angle), height};
      rays[k] = points[k].normalized();
    }
    double nearest = 1e9;
    for (const Pose& pose : solve_p3p(rays, points))
      nearest = std::min(nearest, pose.centre.norm() / height + rotation_angle(pose.rotation, {1, 0, 0, 0}));
    EXPECT_LT(nearest, 1e-7) << height;
  }
}

TEST(P3p, NothingForBadPoints) {
  const std::array<Eigen::Vector3d, 3> points = {Eigen::Vector3d(-1, 0, 5), Eigen::Vector3d(1, 0.5, 6),
                                                 Eigen::Vector3d(0, -1, 4)};
  std::array<Eigen::Vector3d, 3> rays;
  for (std::size_t k = 0; k < 3; ++k) rays[k] = points[k].normalized();
  ASSERT_FALSE(solve_p3p(rays, points).empty());
  auto bad = points;
  bad[2] = bad[0];
  EXPECT_TRUE(solve_p3p(rays, bad).empty()) << "two points are one";
  bad[2].y() = std::nan("");
  EXPECT_TRUE(solve_p3p(rays, bad).empty());
  auto bad_rays = rays;
  bad_rays[1] = bad_rays[0];
  for (const Pose& pose : solve_p3p(bad_rays, points))  // two points on one ray, one behind the other
    for (std::size_t k = 0; k < 3; ++k) EXPECT_GT(to_inside(pose, points[k]).normalized().dot(bad_rays[k]), 1 - 1e-9);
  bad_rays = rays;
  bad_rays[1].z() = std::nan("");
  EXPECT_TRUE(solve_p3p(bad_rays, points).empty());
}

// A ray turned around may meet its point in another pose, but not in the true one.
TEST(P3p, PointsBehindAreNotMet) {
  std::mt19937_64 random(6);
  std::uniform_real_distribution<double> uniform(-1, 1);
  int found = 0, found_turned = 0;
  constexpr int kTrials = 500;
  for (int trial = 0; trial < kTrials; ++trial) {
    std::array<Eigen::Vector3d, 3> rays, points;
    for (std::size_t k = 0; k < 3; ++k) {
      points[k] = {2 * uniform(random), 2 * uniform(random), 3 + 2 * uniform(random)};
      rays[k] = points[k].normalized();
    }
    for (const bool turned : {false, true}) {
      if (turned) rays[1] = -rays[1];
      double nearest = 1e9;
      for (const Pose& pose : solve_p3p(rays, points)) {
        nearest = std::min(nearest, pose.centre.norm() + rotation_angle(pose.rotation, {1, 0, 0, 0}));
        for (std::size_t k = 0; k < 3; ++k)
          EXPECT_GT(to_inside(pose, points[k]).normalized().dot(rays[k]), 1 - 1e-9) << turned;
        found_turned += turned;
      }
      if (turned) {
        EXPECT_GT(nearest, 1e-3);
      } else {
        found += nearest < 1e-5;
      }
    }
  }
  EXPECT_GE(found, kTrials - kTrials / 200) << "near-degenerate triangles only";
  EXPECT_GT(found_turned, 0);
}

// Centres on the circular cylinder over the circle through the points. Two solutions coincide there, and errors grow as
// the square root of the errors of the rays, from rounding (1e-16) to 1e-7; the truth is found all the same. Elsewhere
// errors grow in proportion.
TEST(P3p, OnTheDangerCylinder) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<double> on, beside;
  int missed = 0;
  constexpr int kTrials = 1000;
  for (int trial = 0; trial < kTrials; ++trial) {
    const auto on_circle = [&](double radius, double z) {
      const double angle = 3.14 * uniform(random);
      return Eigen::Vector3d(radius * std::cos(angle), radius * std::sin(angle), z);
    };
    const std::array<Eigen::Vector3d, 3> points = {on_circle(1, 0), on_circle(1, 0), on_circle(1, 0)};
    for (const bool danger : {true, false}) {
      const Pose truth{rotation_exp<double>({uniform(random), uniform(random), uniform(random)}),
                       on_circle(danger ? 1 : 0.5, 2 + uniform(random))};
      std::array<Eigen::Vector3d, 3> rays;
      for (std::size_t k = 0; k < 3; ++k) rays[k] = to_inside(truth, points[k]).normalized();
      double nearest = 1;
      for (const Pose& pose : solve_p3p(rays, points)) nearest = std::min(nearest, (pose.centre - truth.centre).norm());
      (danger ? on : beside).push_back(nearest);
      missed += danger && !(nearest < 1e-3);
    }
  }
  EXPECT_LT(median(beside), 1e-12);
  EXPECT_GT(median(on), 1e-11);
  EXPECT_LT(median(on), 1e-6);
  EXPECT_LE(missed, kTrials / 100) << "by rounding, or thin triangles";
}

TEST(P3p, RefusesPointsOnOneLine) {
  const std::array<Eigen::Vector3d, 3> points = {Eigen::Vector3d(-1, 0, 5), Eigen::Vector3d(0, 0, 5),
                                                 Eigen::Vector3d(1, 0, 5)};
  std::array<Eigen::Vector3d, 3> rays;
  for (std::size_t k = 0; k < 3; ++k) rays[k] = points[k].normalized();
  EXPECT_TRUE(solve_p3p(rays, points).empty());
}

}  // namespace
}  // namespace megablock
