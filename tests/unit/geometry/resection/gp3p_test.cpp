// The generalised three-point problem: the true pose of simulated rigs is among the solutions, and every solution meets
// the points.
#include "geometry/resection/gp3p.h"

#include <gtest/gtest.h>

#include <random>

#include "geometry/resection/p3p.h"

namespace megablock {
namespace {

using Corners = std::array<Eigen::Vector3d, 3>;

struct Case {
  Pose truth;
  Corners origins, directions, points;
};

Case make_case(std::mt19937_64& random, double baseline) {
  std::normal_distribution<double> normal(0, 1);
  const auto vector = [&] { return Eigen::Vector3d(normal(random), normal(random), normal(random)); };
  Case c;
  c.truth = {rotation_exp<double>(2 * vector()), 1000 * vector()};
  for (std::size_t k = 0; k < 3; ++k) {
    c.origins[k] = baseline * vector() + Eigen::Vector3d(0.3, -0.2, 0.1);
    const Eigen::Vector3d inside = 10 * vector();
    c.directions[k] = (inside - c.origins[k]).normalized();
    c.points[k] = c.truth.centre + c.truth.rotation.conjugate() * inside;
  }
  if (baseline == 0) c.origins[1] = c.origins[2] = c.origins[0];
  return c;
}

double distance_to_truth(const Case& c, const Solutions<Pose, 8>& poses) {
  double nearest = 1e9;
  for (const Pose& pose : poses)
    nearest =
        std::min(nearest, (pose.centre - c.truth.centre).norm() + rotation_angle(pose.rotation, c.truth.rotation));
  return nearest;
}

TEST(Gp3p, FindsTheTruthAmongSolutionsThatMeetTheRays) {
  std::mt19937_64 random(5);
  for (const double baseline : {0.01, 0.3, 4.0}) {  // a compact camera head, a vehicle, two positions of a vehicle
    int missed = 0;
    constexpr int kTrials = 1000;
    for (int trial = 0; trial < kTrials; ++trial) {
      const Case c = make_case(random, baseline);
      const Solutions<Pose, 8> poses = solve_gp3p(c.origins, c.directions, c.points);
      for (const Pose& pose : poses)
        for (std::size_t k = 0; k < 3; ++k)
          EXPECT_LT(((to_inside(pose, c.points[k]) - c.origins[k]).normalized() - c.directions[k]).norm(), 1e-6);
      missed += !(distance_to_truth(c, poses) < 1e-5);
    }
    EXPECT_LE(missed, kTrials / 200) << "near-degenerate triangles only, at a baseline of " << baseline << " m";
  }
}

TEST(Gp3p, RaysFromOneCentreAreTheCentralProblem) {
  std::mt19937_64 random(6);
  for (int trial = 0; trial < 200; ++trial) {
    const Case c = make_case(random, 0);
    const Solutions<Pose, 8> rig = solve_gp3p(c.origins, c.directions, c.points);
    const Solutions<Pose, 4> camera = solve_p3p(c.directions, c.points);
    ASSERT_EQ(rig.size(), camera.size());
    for (std::size_t i = 0; i < rig.size(); ++i) {
      const Eigen::Vector3d centre = rig[i].centre + rig[i].rotation.conjugate() * c.origins[0];
      EXPECT_LT((centre - camera[i].centre).norm(), 1e-9);
    }
  }
}

TEST(Gp3p, NothingForBadPoints) {
  std::mt19937_64 random(7);
  const Case good = make_case(random, 1);
  ASSERT_FALSE(solve_gp3p(good.origins, good.directions, good.points).empty());
  Case bad = good;
  bad.points[1] = bad.points[0];
  EXPECT_TRUE(solve_gp3p(bad.origins, bad.directions, bad.points).empty()) << "two points are one";
  bad = good;
  bad.points[2].x() = std::nan("");
  EXPECT_TRUE(solve_gp3p(bad.origins, bad.directions, bad.points).empty());
  bad = good;
  bad.directions[2].x() = std::nan("");
  EXPECT_TRUE(solve_gp3p(bad.origins, bad.directions, bad.points).empty());
}

// A ray turned around may meet its point in another pose, but not in the true one.
TEST(Gp3p, PointsBehindAreNotMet) {
  std::mt19937_64 random(9);
  std::size_t found = 0;
  for (int trial = 0; trial < 200; ++trial) {
    Case c = make_case(random, 1);
    c.directions[0] = -c.directions[0];
    const Solutions<Pose, 8> poses = solve_gp3p(c.origins, c.directions, c.points);
    found += poses.size();
    for (const Pose& pose : poses)
      for (std::size_t k = 0; k < 3; ++k)
        EXPECT_GT((to_inside(pose, c.points[k]) - c.origins[k]).normalized().dot(c.directions[k]), 1 - 1e-9);
    EXPECT_GT(distance_to_truth(c, poses), 1e-3);
  }
  EXPECT_GT(found, 0u);
}

// The rig can slide along parallel rays: every distance solves the equations.
TEST(Gp3p, RefusesParallelRays) {
  std::mt19937_64 random(8);
  for (int trial = 0; trial < 200; ++trial) {
    Case c = make_case(random, 1);
    const Eigen::Vector3d along = c.directions[0];
    const double turned = trial % 2 ? -1 : 1;  // a camera that looks back
    c.directions = {along, turned * along, along};
    for (std::size_t k = 0; k < 3; ++k) {
      const Eigen::Vector3d inside = c.origins[k] + (5.0 + static_cast<double>(k)) * c.directions[k];
      c.points[k] = c.truth.centre + c.truth.rotation.conjugate() * inside;
    }
    EXPECT_TRUE(solve_gp3p(c.origins, c.directions, c.points).empty()) << trial;
    // If only two are parallel, the third determines the position.
    c.directions[2] = (c.directions[2] + Eigen::Vector3d(0.1, -0.2, 0.15)).normalized();
    c.points[2] = c.truth.centre + c.truth.rotation.conjugate() * (c.origins[2] + 7 * c.directions[2]);
    EXPECT_LT(distance_to_truth(c, solve_gp3p(c.origins, c.directions, c.points)), 1e-4) << trial;
  }
}

TEST(Gp3p, RefusesPointsOnOneLine) {
  const Corners points = {Eigen::Vector3d(-1, 0, 5), Eigen::Vector3d(0, 0, 5), Eigen::Vector3d(1, 0, 5)};
  const Corners origins = {Eigen::Vector3d(0.1, 0, 0), Eigen::Vector3d(0, 0.1, 0), Eigen::Vector3d(0, 0, 0.1)};
  Corners directions;
  for (std::size_t k = 0; k < 3; ++k) directions[k] = (points[k] - origins[k]).normalized();
  EXPECT_TRUE(solve_gp3p(origins, directions, points).empty());
}

}  // namespace
}  // namespace megablock
