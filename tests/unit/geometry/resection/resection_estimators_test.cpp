// Resection by RANSAC for single cameras and rigs: the true pose is found among outliers, and is a minimum after the
// adjustment.
#include "geometry/resection/resection_estimators.h"

#include <gtest/gtest.h>

#include <random>

#include "geometry/estimation/ransac.h"

namespace megablock {
namespace {

constexpr double kRayLimit = 4e-3;  // radians; the noise is 1e-3

struct RayScene {
  Pose truth;
  std::vector<PointRay> rays;
  // The cameras are within half a metre of the rig's origin, the points 5 to 30 m away, in front of the first camera or
  // all around.
  RayScene(int cameras, int count, double wrong, std::uint64_t seed) {
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> uniform(-1, 1);
    std::normal_distribution<double> normal(0, 1);
    const auto vector = [&] {
      const double x = normal(random), y = normal(random), z = normal(random);
      return Eigen::Vector3d(x, y, z);
    };
    truth = {rotation_exp<double>(vector()), 50 * vector()};
    for (int i = 0; i < count; ++i) {
      PointRay ray;
      if (cameras > 1)
        ray.origin = Eigen::AngleAxisd(i % cameras, Eigen::Vector3d::UnitY()) * Eigen::Vector3d(0, 0, 0.5);
      const auto anywhere = [&] {
        const Eigen::Vector3d ahead(0.6 * uniform(random), 0.4 * uniform(random), 1);
        return cameras > 1 ? vector().normalized() : ahead.normalized();
      };
      ray.direction = anywhere();
      ray.point =
          truth.centre + truth.rotation.conjugate() * (ray.origin + (17.5 + 12.5 * uniform(random)) * ray.direction);
      if (0.5 * (uniform(random) + 1) < wrong) ray.direction = anywhere();
      ray.direction = (ray.direction + 1e-3 * vector()).normalized();
      rays.push_back(ray);
    }
  }
};

TEST(ResectionEstimator, FindsThePoseAmongOutliers) {
  for (const int cameras : {1, 6})
    for (std::uint64_t seed = 1; seed <= 10; ++seed) {
      const RayScene scene(cameras, 200, 0.6, seed);
      const ResectionEstimator estimator(scene.rays);
      const auto found = ransac(estimator, {.threshold = kRayLimit, .max_draws = 500, .seed = seed});
      ASSERT_TRUE(found);
      EXPECT_NEAR(found->consensus.count, 80, 25);
      EXPECT_LT((found->model.centre - scene.truth.centre).norm(), 0.1);
      EXPECT_LT(rotation_angle(found->model.rotation, scene.truth.rotation), 3e-3);
    }
}

TEST(ResectionEstimator, AdjustmentEndsInAMinimum) {
  const RayScene scene(1, 300, 0, 5);
  const ResectionEstimator estimator(scene.rays);
  Pose start = scene.truth;
  start.centre += Eigen::Vector3d(0.01, -0.01, 0.01);
  const Pose found = estimator.adjusted(start, 1, 20);
  const auto cost = [&](const Pose& pose) {
    const auto squares = estimator.squared_residuals(pose);
    double sum = 0;
    for (std::size_t i = 0; i < estimator.size(); ++i) sum += squares(i);
    return sum;
  };
  for (int k = 0; k < 6; ++k)
    for (const double sign : {-1, 1})
      EXPECT_GT(cost(pose_update(found, sign * 1e-3 * PoseIncrement::Unit(k))), cost(found));
}

TEST(ResectionEstimator, BadInput) {
  const auto count = [](const std::vector<PointRay>& rays) {
    const auto found = ransac(ResectionEstimator(rays), {.threshold = kRayLimit, .max_draws = 200, .seed = 1});
    return found ? found->consensus.count : 0;
  };
  EXPECT_EQ(count({}), 0);
  std::vector<PointRay> two = RayScene(1, 2, 0, 1).rays;
  EXPECT_EQ(count(two), 0);
  EXPECT_EQ(count(std::vector<PointRay>(50, two[0])), 0) << "one point, again and again";
  std::vector<PointRay> line = RayScene(1, 50, 0, 1).rays;
  for (std::size_t i = 0; i < line.size(); ++i) line[i].point = {1.0 * static_cast<double>(i), 2, 3};
  EXPECT_EQ(count(line), 0) << "points on one line";

  // Observations that are not finite, or behind the camera, are never inliers and do no harm.
  RayScene scene(1, 200, 0, 2);
  for (std::size_t i = 0; i < 40; ++i) {
    scene.rays[5 * i].point.x() = std::numeric_limits<double>::quiet_NaN();
    scene.rays[5 * i + 1].direction *= -1;
  }
  const auto found = ransac(ResectionEstimator(scene.rays), {.threshold = kRayLimit, .max_draws = 500, .seed = 1});
  ASSERT_TRUE(found);
  EXPECT_LT((found->model.centre - scene.truth.centre).norm(), 0.1);
  for (std::size_t i = 0; i < 40; ++i) {
    EXPECT_FALSE(found->consensus.inlier[5 * i]);
    EXPECT_FALSE(found->consensus.inlier[5 * i + 1]);
  }
}

}  // namespace
}  // namespace megablock
