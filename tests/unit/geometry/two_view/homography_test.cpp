// Homographies and their orientations: the truth is among them, all explain the points, and rotations and bases along
// the normal are recognised.
#include "geometry/two_view/homography.h"

#include <gtest/gtest.h>

#include <array>

#include "geometry/two_view/fundamental.h"
#include "geometry/two_view/rotation_pair.h"
#include "tests/support/geometry/pair_scene.h"

namespace megablock {
namespace {

// A plane n.X = 1 that is seen from both images, at random.
struct PlaneScene {
  std::vector<Eigen::Vector3d> a, b;
  RelativeOrientation truth;
  Eigen::Vector3d normal;
  double base_to_distance;

  PlaneScene(std::mt19937_64& random, std::size_t count, double base) {
    std::uniform_real_distribution<double> uniform(-1, 1);
    normal = (Eigen::Vector3d::UnitZ() + 0.5 * random_direction(random)).normalized();
    const double distance = 5;
    truth = {rotation_exp<double>(0.5 * uniform(random) * random_direction(random)), random_direction(random)};
    base_to_distance = base / distance;
    while (a.size() < count) {
      const Eigen::Vector3d ray(0.6 * uniform(random), 0.6 * uniform(random), 1);
      const Eigen::Vector3d point = distance / normal.dot(ray) * ray;
      a.push_back(point.normalized());
      b.push_back((truth.rotation * point + base * truth.base).normalized());
    }
  }
};

TEST(Homography, OneOfItsOrientationsIsTheTruthAndAllExplainThePoints) {
  std::mt19937_64 random(21);
  for (int trial = 0; trial < 300; ++trial) {
    const PlaneScene scene(random, trial % 2 ? 4 : 20, 1);
    const auto h = fit_homography(scene.a, scene.b);
    ASSERT_TRUE(h);
    for (std::size_t i = 0; i < scene.a.size(); ++i) EXPECT_LT(angle_between(*h * scene.a[i], scene.b[i]), 1e-9);
    const auto all = orientations_of_homography(*h);
    ASSERT_EQ(all.size(), 4u);
    double nearest = 1e9;
    for (const PlanarOrientation& o : all) {
      const Eigen::Matrix3d again =
          o.orientation.rotation.toRotationMatrix() + o.base_to_distance * o.orientation.base * o.normal.transpose();
      EXPECT_LT((again - *h).norm(), 1e-8) << "each is the same homography";
      nearest = std::min(nearest, nearest_error_deg(std::array{o.orientation}, scene.truth) +
                                      degrees(angle_between(o.normal, scene.normal)) +
                                      std::abs(o.base_to_distance - scene.base_to_distance));
    }
    EXPECT_LT(nearest, 1e-5);
    const auto twins = visible_orientations(*h, scene.a);
    double visible = 1e9;
    for (const PlanarOrientation& o : twins)
      visible = std::min(visible, nearest_error_deg(std::array{o.orientation}, scene.truth));
    EXPECT_LT(visible, 1e-5) << "the truth is among those with the plane in front";
  }
}

TEST(Homography, OfOneCentreIsARotation) {
  std::mt19937_64 random(22);
  for (int trial = 0; trial < 50; ++trial) {
    const PlaneScene scene(random, 10, 0);
    const auto h = fit_homography(scene.a, scene.b);
    ASSERT_TRUE(h);
    const auto only = orientations_of_homography(*h);
    ASSERT_EQ(only.size(), 1u);
    EXPECT_EQ(only.front().base_to_distance, 0);
    EXPECT_LT(rotation_error_deg(only.front().orientation, scene.truth), 1e-9);
    EXPECT_EQ(visible_orientations(*h, scene.a).size(), 1u);
  }
}

TEST(Homography, BaseAlongTheNormalHasOneSolutionTwice) {
  const Eigen::Vector3d normal = Eigen::Vector3d(0.1, 0.2, 1).normalized();
  const Eigen::Quaterniond rotation = rotation_exp<double>({0.1, 0.2, -0.3});
  const Eigen::Vector3d base = rotation * normal;
  const auto all = orientations_of_homography(rotation.toRotationMatrix() - 0.2 * base * normal.transpose());
  ASSERT_EQ(all.size(), 4u);
  for (const PlanarOrientation& o : all) {
    EXPECT_LT(rotation_angle(o.orientation.rotation, rotation), 1e-7);
    EXPECT_NEAR(o.base_to_distance, 0.2, 1e-9);
    EXPECT_LT(o.orientation.base.cross(base).norm(), 1e-7);
  }
}

TEST(Homography, PixelsAgreeWithRays) {
  std::mt19937_64 random(23);
  const PlaneScene scene(random, 12, 1);
  Eigen::Matrix3d k;
  k << 4000, 0, 3000, 0, 4000, 2000, 0, 0, 1;
  std::vector<Eigen::Vector2d> a, b;
  for (std::size_t i = 0; i < scene.a.size(); ++i) {
    a.push_back((k * scene.a[i]).hnormalized());
    b.push_back((k * scene.b[i]).hnormalized());
  }
  const auto pixels = fit_pixel_homography(a, b), rays = fit_homography(scene.a, scene.b);
  ASSERT_TRUE(pixels && rays);
  const Eigen::Matrix3d expected = k * *rays * k.inverse();
  const double sign = expected.cwiseProduct(*pixels).sum() > 0 ? 1 : -1;
  EXPECT_LT((sign * expected / expected.norm() - *pixels).norm(), 1e-12);
}

TEST(Homography, NothingForBadPoints) {
  std::mt19937_64 random(24);
  const PlaneScene scene(random, 4, 1);
  const std::vector<Eigen::Vector3d> three(scene.a.begin(), scene.a.begin() + 3);
  EXPECT_FALSE(fit_homography(three, three));
  auto bad = scene.a;
  bad[0].x() = std::nan("");
  EXPECT_FALSE(fit_homography(bad, scene.b));
  auto bad_b = scene.b;
  bad = scene.a;
  bad[0] = bad[1];
  bad_b[0] = bad_b[1];
  EXPECT_FALSE(fit_homography(bad, bad_b)) << "two points are one";
  bad_b = scene.b;
  bad_b[2] = -bad_b[2];
  EXPECT_FALSE(fit_homography(scene.a, bad_b)) << "a point behind";
  for (std::size_t i = 0; i < 4; ++i)
    bad[i] = (Eigen::Vector3d(-0.5, 0.1, 2) + static_cast<double>(i) * Eigen::Vector3d(0.2, 0.1, 0.1)).normalized();
  EXPECT_FALSE(fit_homography(bad, bad)) << "all on one line";
  EXPECT_TRUE(orientations_of_homography(Eigen::Matrix3d::Constant(std::nan(""))).empty());
}

TEST(Homography, NothingForBadPixels) {
  const std::vector<Eigen::Vector2d> square = {{0, 0}, {100, 0}, {100, 80}, {0, 80}};
  ASSERT_TRUE(fit_pixel_homography(square, square));
  EXPECT_FALSE(fit_pixel_homography(std::span(square).first(3), std::span(square).first(3)));
  auto bad = square;
  bad[2].y() = std::nan("");
  EXPECT_FALSE(fit_pixel_homography(bad, square));
  bad = square;
  bad[0] = bad[1];
  EXPECT_FALSE(fit_pixel_homography(bad, bad)) << "two points are one";
  for (std::size_t i = 0; i < 4; ++i) bad[i] = static_cast<double>(i) * Eigen::Vector2d(3, 2);
  EXPECT_FALSE(fit_pixel_homography(bad, bad)) << "all on one line";
  EXPECT_FALSE(fit_pixel_homography(std::vector<Eigen::Vector2d>(4, {5, 5}), square)) << "all in one place";
}

TEST(RotationPair, TwoRaysGiveTheRotationOfOneCentre) {
  std::mt19937_64 random(25);
  for (int trial = 0; trial < 200; ++trial) {
    const Eigen::Quaterniond truth = rotation_exp<double>(3 * random_direction(random));
    const Eigen::Vector3d a = random_direction(random), b = random_direction(random);
    const auto found = solve_rotation_pair(a, b, truth * a, truth * b);
    ASSERT_TRUE(found);
    EXPECT_LT(rotation_angle(*found, truth), 1e-10);
  }
  // A misfit of the angle between the rays is shared equally.
  const auto shared =
      solve_rotation_pair({0, 0, 1}, {std::sin(0.3), 0, std::cos(0.3)}, {0, 0, 1}, {std::sin(0.32), 0, std::cos(0.32)});
  ASSERT_TRUE(shared);
  EXPECT_NEAR(rotation_angle(*shared, Eigen::Quaterniond::Identity()), 0.01, 1e-12);
}

TEST(RotationPair, NothingForRaysOnOneLine) {
  const Eigen::Vector3d x = Eigen::Vector3d::UnitX(), y = Eigen::Vector3d::UnitY();
  EXPECT_FALSE(solve_rotation_pair(x, x, x, y));
  EXPECT_FALSE(solve_rotation_pair(x, y, y, -y));
  for (std::size_t none = 0; none < 4; ++none) {
    std::array<Eigen::Vector3d, 4> rays = {x, y, y, x};
    rays[none].setConstant(std::nan(""));
    EXPECT_FALSE(solve_rotation_pair(rays[0], rays[1], rays[2], rays[3])) << none;
  }
}

}  // namespace
}  // namespace megablock
