// Minimal solvers run millions of times. Therefore none may allocate memory on the heap, with or without solutions.
#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "geometry/camera/camera_matrix.h"
#include "geometry/camera/collinearity.h"
#include "geometry/intersection/two_rays.h"
#include "geometry/resection/gp3p.h"
#include "geometry/resection/p3p.h"
#include "geometry/similarity/minimal_control.h"
#include "geometry/similarity/minimal_similarity.h"
#include "geometry/similarity/similarity.h"
#include "geometry/two_view/coplanarity.h"
#include "geometry/two_view/five_point.h"
#include "geometry/two_view/fundamental.h"
#include "geometry/two_view/homography.h"
#include "geometry/two_view/rotation_pair.h"
#include "geometry/two_view/vertical_pair.h"
#include "tests/support/geometry/pair_scene.h"
#include "tests/unit/allocations/counted_allocations.h"

namespace megablock {
namespace {

template <typename Work>
std::int64_t allocations_of(const Work& work) {
  const std::int64_t before = allocation_count();
  work();
  return allocation_count() - before;
}

TEST(Allocations, AreCountedOfContainersAndMatrices) {
  std::vector<double> numbers;
  Eigen::MatrixXd dynamic;
  Eigen::Matrix3d fixed;
  EXPECT_EQ(allocations_of([&] { numbers.resize(1000); }), 1);
  EXPECT_EQ(allocations_of([&] { dynamic.setZero(40, 40); }), 1);
  EXPECT_EQ(allocations_of([&] { fixed.setZero(); }), 0);
}

// General, plane, forward, plane along its normal, no base; exact and with noise; the last with NaN among its rays.
std::vector<PairScene> scenes() {
  std::vector<PairScene> result;
  std::mt19937_64 random(1);
  for (const double noise_px : {0.0, 0.5})
    for (const bool plane : {false, true})
      for (const Eigen::Vector3d& base : {Eigen::Vector3d(0.3, 0.1, 0), Eigen::Vector3d(0, 0, 0.3),
                                          Eigen::Vector3d(0.01, 0, 0), Eigen::Vector3d(0, 0, 0)})
        for (int repetition = 0; repetition < 25; ++repetition) {
          PairSceneOptions options;
          options.rotation = rotation_exp<double>({0, 0.01 * repetition, 0});
          options.plane = plane;
          options.base = base;
          options.noise_px = noise_px;
          result.emplace_back(options, 8, random);
        }
  result.push_back(result.front());
  result.back().a[1].x() = std::nan("");
  return result;
}

// `solve` returns how many solutions there are.
template <typename Solve>
void expect_no_allocation(const char* what, const Solve& solve) {
  const std::vector<PairScene> all = scenes();
  std::size_t found = 0;
  EXPECT_EQ(allocations_of([&] {
              for (const PairScene& scene : all) found += solve(scene);
            }),
            0)
      << what;
  EXPECT_GT(found, all.size() / 4) << what;
}

template <std::size_t N>
std::array<Eigen::Vector2d, N> pixels(const std::vector<Eigen::Vector3d>& rays) {
  std::array<Eigen::Vector2d, N> result;
  for (std::size_t i = 0; i < N; ++i) result[i] = kSceneFocalPx * rays[i].hnormalized();
  return result;
}

// Rays of `a` as points at different depths.
std::array<Eigen::Vector3d, 3> points_on(const PairScene& scene) {
  return {2 * scene.a[0], 1.5 * scene.a[1], 3 * scene.a[2]};
}

TEST(Allocations, NoneInRelativeOrientation) {
  const Eigen::Vector3d down = Eigen::Vector3d::UnitY();
  expect_no_allocation("three points and the vertical", [&](const PairScene& s) {
    return solve_vertical_pair(s.first<3>(s.a), s.first<3>(s.b), down, down).size();
  });
  expect_no_allocation("five points",
                       [](const PairScene& s) { return solve_five_point(s.first<5>(s.a), s.first<5>(s.b)).size(); });
  expect_no_allocation("five points in front", [](const PairScene& s) {
    return solve_five_point_in_front(s.first<5>(s.a), s.first<5>(s.b)).size();
  });
  expect_no_allocation("seven points",
                       [](const PairScene& s) { return solve_seven_point(pixels<7>(s.a), pixels<7>(s.b)).size(); });
  expect_no_allocation("eight points, fundamental matrix", [](const PairScene& s) -> std::size_t {
    return fit_fundamental(pixels<8>(s.a), pixels<8>(s.b)).has_value();
  });
  expect_no_allocation("eight points, essential matrix", [](const PairScene& s) {
    const auto essential = fit_essential(s.a, s.b);
    return essential ? orientations_of_essential(*essential).size() : 0;
  });
  expect_no_allocation("homography of four and more", [](const PairScene& s) {
    const auto homography = fit_homography(s.first<4>(s.a), s.first<4>(s.b));
    return homography ? orientations_of_homography(*homography).size() + visible_orientations(*homography, s.a).size()
                      : 0;
  });
  expect_no_allocation("homography of four", [](const PairScene& s) -> std::size_t {
    return solve_four_point_homography(s.first<4>(s.a), s.first<4>(s.b)).has_value();
  });
  expect_no_allocation("rotation only", [](const PairScene& s) -> std::size_t {
    return solve_rotation_pair(s.a[0], s.a[1], s.b[0], s.b[1]).has_value();
  });
}

TEST(Allocations, NoneInPosesSimilaritiesAndIntersections) {
  const Pose truth{rotation_exp<double>({0.2, -0.4, 0.9}), {1, 2, 3}};
  const auto outside = [&](std::array<Eigen::Vector3d, 3> points) {
    for (Eigen::Vector3d& p : points) p = truth.centre + truth.rotation.conjugate() * p;
    return points;
  };
  expect_no_allocation("three points and a camera",
                       [&](const PairScene& s) { return solve_p3p(s.first<3>(s.a), outside(points_on(s))).size(); });
  expect_no_allocation("three points and a rig", [&](const PairScene& s) {
    const std::array<Eigen::Vector3d, 3> origins = {Eigen::Vector3d(0, 0, 0), {0.3, 0, 0.1}, {0, 0.2, -0.1}};
    std::array<Eigen::Vector3d, 3> points = points_on(s);
    for (std::size_t k = 0; k < 3; ++k) points[k] += origins[k];
    return solve_gp3p(origins, s.first<3>(s.a), outside(points)).size();
  });
  expect_no_allocation("similarity of three points", [&](const PairScene& s) -> std::size_t {
    return solve_similarity(points_on(s), outside(points_on(s))).has_value();
  });
  expect_no_allocation("similarity of three points and more, with its covariance", [&](const PairScene& s) {
    const std::array<Eigen::Vector3d, 3> from = points_on(s), to = outside(from);
    const std::array<double, 3> weights = {1, 2, 0.5};
    const auto fitted = fit_similarity(from, to, weights);
    return fitted ? std::size_t{similarity_covariance(*fitted, from, weights).has_value()} : 0;
  });
  expect_no_allocation("minimal control", [&](const PairScene& s) {
    const std::array<Eigen::Vector3d, 3> model = points_on(s), ground = outside(model);
    const auto place = [&](std::size_t i) { return PlaceControl{model[i], ground[i].head<2>()}; };
    const auto height = [&](std::size_t i) { return HeightControl{model[i], ground[i].z()}; };
    return solve_minimal_control({place(0), place(1)}, {height(0), height(1), height(2)}).size() +
           solve_minimal_control({place(0), place(1), place(2)}, height(0)).size();
  });
  expect_no_allocation("intersection of rays", [](const PairScene& s) -> std::size_t {
    const Eigen::Vector3d first = Eigen::Vector3d::Zero(), second(1, 0, 0), point = 3 * s.a[0];
    const std::array<Ray, 2> rays = {Ray{first, point.normalized()}, Ray{second, (point - second).normalized()}};
    return intersect_two_rays(rays[0], rays[1]).has_value() + intersect_rays(rays).has_value();
  });
  expect_no_allocation("coplanarity determinant", [](const PairScene& s) -> std::size_t {
    const XyzAngles first{3.1, 0.1, 0.2}, second{3.0, -0.1, 0.1};
    const Eigen::Vector2d a = s.a[0].hnormalized(), b = s.b[0].hnormalized();
    return std::isfinite(coplanarity_determinant({1, 0, 0}, 1, first, a, second, b).value);
  });
}

TEST(Allocations, NoneInTheImageFormula) {
  const Pose pose{rotation_exp<double>({0.2, -0.4, 0.9}), {1, 2, 3}};
  const NineParameters camera = nine_from(pose, kSceneFocalPx, {12, -7});
  NineParameters near = camera;
  near.centre.x() += 0.01;
  NineParameters aside = camera;
  aside.centre.y() += 0.3;
  // Rays of `a` as control points at different depths.
  const auto ground = [&](const PairScene& scene) {
    std::array<Eigen::Vector3d, 8> points;
    for (std::size_t i = 0; i < 8; ++i)
      points[i] = pose.centre + pose.rotation.conjugate() * ((2 + 0.3 * static_cast<double>(i * i % 7)) * scene.a[i]);
    return points;
  };
  const auto seen = [&](const std::array<Eigen::Vector3d, 8>& points) {
    std::array<Eigen::Vector2d, 8> image;
    for (std::size_t i = 0; i < 8; ++i) image[i] = project(camera, points[i]);
    return image;
  };
  expect_no_allocation("direct linear transformation", [&](const PairScene& s) -> std::size_t {
    return fit_eleven(ground(s), seen(ground(s))).has_value();
  });
  expect_no_allocation("nine parameters by least squares", [&](const PairScene& s) -> std::size_t {
    return fit_nine(near, ground(s), seen(ground(s))).has_value();
  });
  expect_no_allocation("nine to eleven and back", [&](const PairScene& s) -> std::size_t {
    const auto eleven = eleven_from(camera, ground(s)[0]);
    return eleven && nine_from(*eleven).has_value();
  });
  expect_no_allocation("point of eleven parameters", [&](const PairScene& s) -> std::size_t {
    const Eigen::Vector3d point = ground(s)[0], origin = origin_before(camera, 3);
    const auto first = eleven_from(camera, origin), second = eleven_from(aside, origin);
    if (!first || !second) return 0;
    const std::array<ElevenParameters, 2> images = {*first, *second};
    return restitute(images, std::array<Eigen::Vector2d, 2>{project(camera, point), project(aside, point)}).has_value();
  });
  expect_no_allocation("camera matrix into its parts", [&](const PairScene& s) -> std::size_t {
    const CameraMatrix matrix =
        camera_matrix({Eigen::Vector3d(kSceneFocalPx, kSceneFocalPx, 1).asDiagonal(), {s.truth.rotation, s.a[0]}});
    return decompose_camera_matrix(matrix).has_value() + decompose_camera_matrix(matrix, ground(s)[0]).has_value();
  });
}

}  // namespace
}  // namespace megablock
