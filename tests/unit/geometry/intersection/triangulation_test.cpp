// Intersection of rays: exact rays give the point, the linear solution and the refinement are minima of their costs,
// and degenerate rays are refused.
#include "geometry/intersection/triangulation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include "partition/views/views.h"

namespace megablock {
namespace {

constexpr Intrinsics kCamera = {1200, 960, 640, -0.1, 0.02, 0, 1e-3, -5e-4};
// Ground coordinates are large: millimetres are wanted in a block of 100 km.
const Eigen::Vector3d kFar(52000, -31000, 200);

// A ring of cameras around `target`, all looking at it.
std::vector<Pose> ring(const Eigen::Vector3d& target, int count, double radius) {
  std::vector<Pose> poses;
  for (int i = 0; i < count; ++i) {
    const double angle = 0.3 * i;
    const Eigen::Vector3d centre = target + radius * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0.2 * i);
    const Eigen::Vector3d forward = (target - centre).normalized();
    const Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitZ()).normalized();
    Eigen::Matrix3d rotation;
    rotation << right.transpose(), forward.cross(right).transpose(), forward.transpose();
    poses.push_back({Eigen::Quaterniond(rotation).normalized(), centre});
  }
  return poses;
}

std::vector<PointView> views_of(const Eigen::Vector3d& point, const std::vector<Pose>& poses) {
  std::vector<PointView> views;
  for (const Pose& pose : poses) views.push_back({pose, &kCamera, project(kCamera, to_inside(pose, point)), 2.0});
  return views;
}

double squared_error(const Eigen::Vector3d& point, const std::vector<PointView>& views) {
  double sum = 0;
  for (const PointView& view : views)
    sum += ((project(kCamera, to_inside(view.camera, point)) - view.pixel) * view.inverse_sigma).squaredNorm();
  return sum;
}

TEST(Triangulation, RecoversThePointOfExactRays) {
  const Eigen::Vector3d point = kFar + Eigen::Vector3d(1, -2, 0.5);
  for (int count : {2, 3, 8}) {
    const auto views = views_of(point, ring(kFar, count, 20));
    std::vector<Ray> rays;
    for (const PointView& view : views) rays.push_back(ground_ray(view.camera, kCamera, view.pixel).value());
    const auto linear = intersect_rays(rays);
    ASSERT_TRUE(linear);
    EXPECT_LT((*linear - point).norm(), 1e-7) << count << " rays";
    const auto refined = triangulate(views);
    ASSERT_TRUE(refined);
    EXPECT_LT((refined->position - point).norm(), 1e-8) << count << " rays";
  }
}

TEST(Triangulation, LinearSolutionIsTheMinimumOfWeightedDistances) {
  const std::vector<Ray> rays = {{{0, 0, 0}, Eigen::Vector3d(1, 0.1, 0).normalized(), 1},
                                 {{5, -4, 1}, Eigen::Vector3d(0.1, 1, 0).normalized(), 3},
                                 {{4, 1, -6}, Eigen::Vector3d(0, 0.1, 1).normalized(), 0.5}};
  const auto cost = [&](const Eigen::Vector3d& m) {
    double sum = 0;
    for (const Ray& ray : rays) sum += ray.weight * ray.direction.cross(m - ray.origin).squaredNorm();
    return sum;
  };
  const auto point = intersect_rays(rays);
  ASSERT_TRUE(point);
  for (int axis = 0; axis < 3; ++axis)
    for (double step : {-1e-3, 1e-3}) EXPECT_GT(cost(*point + step * Eigen::Vector3d::Unit(axis)), cost(*point));
}

TEST(Triangulation, RefinementIsStationaryAndBetterThanTheTruth) {
  std::mt19937 random(7);
  std::normal_distribution<double> noise(0, 0.5);
  for (int trial = 0; trial < 20; ++trial) {
    const Eigen::Vector3d point = kFar + Eigen::Vector3d(noise(random), noise(random), noise(random));
    auto views = views_of(point, ring(kFar, 5, 20));
    for (PointView& view : views) view.pixel += Eigen::Vector2d(noise(random), noise(random));
    const auto refined = triangulate(views);
    ASSERT_TRUE(refined);
    EXPECT_NEAR(refined->squared_error, squared_error(refined->position, views), 1e-9);
    EXPECT_LT(refined->squared_error, squared_error(point, views));
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d step = 1e-4 * Eigen::Vector3d::Unit(axis);
      EXPECT_GT(squared_error(refined->position + step, views), refined->squared_error);
      EXPECT_GT(squared_error(refined->position - step, views), refined->squared_error);
    }
  }
}

TEST(Triangulation, RefusesWhatHasNoIntersection) {
  const Eigen::Vector3d x = Eigen::Vector3d::UnitX(), z = Eigen::Vector3d::UnitZ();
  EXPECT_FALSE(intersect_rays({}));
  EXPECT_FALSE(intersect_rays(std::vector<Ray>{{Eigen::Vector3d::Zero(), x}}));
  EXPECT_FALSE(intersect_rays(std::vector<Ray>{{Eigen::Vector3d::Zero(), x}, {z, x}})) << "parallel";
  const Eigen::Vector3d apart = Eigen::Vector3d(1, 0, 0.1).normalized();
  EXPECT_FALSE(intersect_rays(std::vector<Ray>{{Eigen::Vector3d::Zero(), x}, {z, apart}})) << "meets behind";

  auto poses = ring(kFar, 2, 20);
  auto views = views_of(kFar, poses);
  EXPECT_FALSE(triangulate(std::vector<PointView>{views[0]}));
  auto broken = views;
  broken[1].pixel.x() = std::nan("");
  EXPECT_FALSE(triangulate(broken)) << "not a number";
  EXPECT_FALSE(intersect_rays(std::vector<Ray>{{Eigen::Vector3d::Zero(), x}, {z, std::nan("") * apart}}));
  EXPECT_FALSE(refine_point(poses[0].centre - 5 * (kFar - poses[0].centre), views)) << "start behind a camera";
}

// In grid coordinates the mean of three equal centres is not always that centre, and the rays seem to meet in front of
// it.
TEST(Triangulation, RefusesRaysOfOneCentre) {
  std::mt19937_64 random(8);
  std::normal_distribution<double> normal(0, 1);
  const auto vector = [&] {
    const double x = normal(random), y = normal(random), z = normal(random);
    return Eigen::Vector3d(x, y, z);
  };
  for (const double rounding : {0.0, std::numeric_limits<double>::epsilon()})  // computed centres, too
    for (int trial = 0; trial < 200; ++trial) {
      const Eigen::Vector3d centre = Eigen::Vector3d(652123.4, 6862345.6, 321.7) + vector();
      std::vector<Ray> rays;
      for (int k = -1; k <= 1; ++k)
        rays.push_back({(1 + k * rounding) * centre, (Eigen::Vector3d::UnitZ() + 0.3 * vector()).normalized()});
      EXPECT_FALSE(intersect_rays(rays)) << trial;
    }
}

TEST(Triangulation, LargestAngleOfAllPairs) {
  const std::vector<Eigen::Vector3d> centres = {{10, 0, 0}, {7, 7, 0}, {-3, 0, 0}, {0, 5, 0}};
  EXPECT_NEAR(max_intersection_angle({0, 0, 0}, centres), std::numbers::pi, 1e-12);
  EXPECT_NEAR(max_intersection_angle({0, 0, 0}, std::vector<Eigen::Vector3d>{centres[0], centres[1]}),
              std::numbers::pi / 4, 1e-12);
  EXPECT_EQ(max_intersection_angle({0, 0, 0}, std::vector<Eigen::Vector3d>{centres[0]}), 0);
}

}  // namespace
}  // namespace megablock
