// Fundamental and essential matrices from seven and more points, against the simulated truth.
#include "geometry/two_view/fundamental.h"

#include <gtest/gtest.h>

#include "tests/support/geometry/pair_scene.h"

namespace megablock {
namespace {

Eigen::Matrix3d scene_camera() {
  Eigen::Matrix3d k;
  k << kSceneFocalPx, 0, 176, 0, kSceneFocalPx, 144, 0, 0, 1;
  return k;
}

struct PixelScene {
  std::vector<Eigen::Vector2d> a, b;
  Eigen::Matrix3d truth;  // Frobenius norm one

  explicit PixelScene(const PairScene& scene) {
    const Eigen::Matrix3d k = scene_camera(), back = k.inverse();
    for (std::size_t i = 0; i < scene.a.size(); ++i) {
      a.push_back((k * scene.a[i]).hnormalized());
      b.push_back((k * scene.b[i]).hnormalized());
    }
    truth = back.transpose() * essential_from(scene.truth) * back;
    truth /= truth.norm();
  }
};

double difference(const Eigen::Matrix3d& p, const Eigen::Matrix3d& q) {
  return std::min((p - q).norm(), (p + q).norm());
}

PairSceneOptions turned(double noise_px = 0) {
  PairSceneOptions options;
  options.rotation = rotation_exp<double>({0.1, 0.2, -0.15});
  options.base = {0.3, 0.1, 0.05};
  options.noise_px = noise_px;
  return options;
}

TEST(Fundamental, SevenPointsGiveTheTruthAmongOneOrThree) {
  std::mt19937_64 random(31);
  std::array<int, 4> counts{};
  for (int trial = 0; trial < 500; ++trial) {
    const PixelScene scene(PairScene(turned(), 7, random));
    std::array<Eigen::Vector2d, 7> a, b;
    std::copy_n(scene.a.begin(), 7, a.begin());
    std::copy_n(scene.b.begin(), 7, b.begin());
    double nearest = 1e9;
    const auto found = solve_seven_point(a, b);
    ++counts[found.size()];
    for (const Eigen::Matrix3d& f : found) {
      nearest = std::min(nearest, difference(f, scene.truth));
      EXPECT_NEAR(f.determinant(), 0, 1e-14);
      for (std::size_t i = 0; i < 7; ++i) EXPECT_LT(std::abs(b[i].homogeneous().dot(f * a[i].homogeneous())), 1e-9);
    }
    EXPECT_LT(nearest, 1e-5);
  }
  EXPECT_EQ(counts[0], 0);
  EXPECT_GT(counts[1], 50);
  EXPECT_GT(counts[3], 50);
}

TEST(Fundamental, EightAndMorePoints) {
  std::mt19937_64 random(32);
  for (const std::size_t count : {std::size_t{8}, std::size_t{9}, std::size_t{200}}) {
    const PairScene rays(turned(), count, random);
    const PixelScene scene(rays);
    const auto f = fit_fundamental(scene.a, scene.b);
    const auto e = fit_essential(rays.a, rays.b);
    ASSERT_TRUE(f && e);
    EXPECT_LT(difference(*f, scene.truth), 1e-8) << count;
    EXPECT_LT(difference(*e, essential_from(rays.truth) / std::sqrt(2.0)), 1e-9) << count;
    EXPECT_LT(nearest_error_deg(orientations_of_essential(*e), rays.truth), 1e-7);
  }
  const PairScene noisy(turned(0.5), 1000, random);
  EXPECT_LT(nearest_error_deg(orientations_of_essential(fit_essential(noisy.a, noisy.b).value()), noisy.truth), 2);
  const PixelScene pixels(noisy);
  const Eigen::Matrix3d k = scene_camera(), f = fit_fundamental(pixels.a, pixels.b).value();
  EXPECT_LT(nearest_error_deg(orientations_of_essential(nearest_essential(k.transpose() * f * k)), noisy.truth), 2);
}

TEST(Fundamental, NothingForBadPoints) {
  std::mt19937_64 random(33);
  const PairScene rays(turned(), 8, random);
  const PixelScene scene(rays);
  const std::vector<Eigen::Vector2d> seven(scene.a.begin(), scene.a.begin() + 7);
  EXPECT_FALSE(fit_fundamental(seven, seven));
  auto bad = scene.a;
  bad[4].y() = std::nan("");
  EXPECT_FALSE(fit_fundamental(bad, scene.b));
  bad = scene.a;
  auto bad_b = scene.b;
  bad[4] = bad[5];
  bad_b[4] = bad_b[5];
  EXPECT_FALSE(fit_fundamental(bad, bad_b)) << "two points are one";
  EXPECT_FALSE(fit_fundamental(std::vector<Eigen::Vector2d>(9, {5, 5}), std::vector<Eigen::Vector2d>(9, {5, 5})));
  PairSceneOptions plane = turned();
  plane.plane = true;
  const PairScene flat(plane, 20, random);
  EXPECT_FALSE(fit_essential(flat.a, flat.b)) << "all in one plane";
  const PixelScene flat_pixels(flat);
  EXPECT_FALSE(fit_fundamental(flat_pixels.a, flat_pixels.b)) << "all in one plane";
  PairSceneOptions centre = turned();
  centre.base.setZero();
  const PairScene still(centre, 20, random);
  EXPECT_FALSE(fit_essential(still.a, still.b)) << "no base";
  const PixelScene still_pixels(still);
  EXPECT_FALSE(fit_fundamental(still_pixels.a, still_pixels.b)) << "no base";
  PairScene line(turned(), 0, random);
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector3d point = Eigen::Vector3d(-0.5, 0.1, 2) + 0.05 * i * Eigen::Vector3d(1, 0.3, 0.5);
    line.a.push_back(point.normalized());
    line.b.push_back((turned().rotation * point + turned().base).normalized());
  }
  EXPECT_FALSE(fit_essential(line.a, line.b)) << "all on one line";
  const PixelScene seen_line(line);
  EXPECT_FALSE(fit_fundamental(seen_line.a, seen_line.b)) << "all on one line";
  std::vector<Eigen::Vector3d> unknown = rays.a;
  unknown[2].x() = std::nan("");
  EXPECT_FALSE(fit_essential(unknown, rays.b));
  EXPECT_FALSE(fit_essential(std::span(rays.a).first(7), std::span(rays.b).first(7)));
  std::vector<Eigen::Vector3d> twice_a = rays.a, twice_b = rays.b;
  twice_a[4] = twice_a[5];
  twice_b[4] = twice_b[5];
  EXPECT_TRUE(fit_essential(rays.a, rays.b));
  EXPECT_FALSE(fit_essential(twice_a, twice_b)) << "two points are one";
}

TEST(Fundamental, NothingForSevenBadPoints) {
  std::mt19937_64 random(34);
  const auto seven = [](const std::vector<Eigen::Vector2d>& points) {
    std::array<Eigen::Vector2d, 7> first;
    std::copy_n(points.begin(), 7, first.begin());
    return first;
  };
  const PixelScene scene(PairScene(turned(), 7, random));
  auto a = seven(scene.a), b = seven(scene.b);
  EXPECT_FALSE(solve_seven_point(a, b).empty());
  a[4] = a[5];
  b[4] = b[5];
  EXPECT_TRUE(solve_seven_point(a, b).empty()) << "two points are one";
  PairSceneOptions plane = turned();
  plane.plane = true;
  const PixelScene flat(PairScene(plane, 7, random));
  EXPECT_TRUE(solve_seven_point(seven(flat.a), seven(flat.b)).empty()) << "all in one plane";
  PairSceneOptions centre = turned();
  centre.base.setZero();
  const PixelScene still(PairScene(centre, 7, random));
  EXPECT_TRUE(solve_seven_point(seven(still.a), seven(still.b)).empty()) << "no base";
  std::array<Eigen::Vector2d, 7> line;
  for (std::size_t i = 0; i < 7; ++i) line[i] = static_cast<double>(i) * Eigen::Vector2d(3, 2);
  EXPECT_TRUE(solve_seven_point(line, line).empty()) << "all on one line";
  line[0].x() = std::nan("");
  EXPECT_TRUE(solve_seven_point(line, line).empty());
}

}  // namespace
}  // namespace megablock
