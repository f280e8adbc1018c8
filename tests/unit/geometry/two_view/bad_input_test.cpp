// Bad input that every solver of relative orientation must survive: a value that is not finite, in any place; a
// correspondence given twice; fewer correspondences than needed. Cases that concern only some solvers (lines, planes,
// no base, points behind) are tested with those.
#include <gtest/gtest.h>

#include <functional>

#include "geometry/camera/collinearity.h"
#include "geometry/intersection/two_rays.h"
#include "geometry/resection/gp3p.h"
#include "geometry/resection/p3p.h"
#include "geometry/similarity/minimal_similarity.h"
#include "geometry/similarity/similarity.h"
#include "geometry/similarity/similarity_adjustment.h"
#include "geometry/two_view/five_point.h"
#include "geometry/two_view/fundamental.h"
#include "geometry/two_view/homography.h"
#include "geometry/two_view/rotation_pair.h"
#include "geometry/two_view/vertical_pair.h"
#include "tests/support/geometry/pair_scene.h"

namespace megablock {
namespace {

using Numbers = std::vector<double>;

// The input as a list of correspondences with `width` numbers each, followed by numbers that belong to none.
struct SolverCase {
  const char* name;
  std::size_t correspondences, width;
  Numbers input;
  std::function<std::size_t(const Numbers&)> solve;  // returns the number of solutions
  bool any_number = false;                           // the solver also takes more correspondences
};

template <int N>
Eigen::Matrix<double, N, 1> part(const Numbers& input, std::size_t at) {
  return Eigen::Map<const Eigen::Matrix<double, N, 1>>(input.data() + at);
}
// The vectors that begin at `first` in every correspondence of so many numbers.
template <int N, std::size_t Count>
std::array<Eigen::Matrix<double, N, 1>, Count> parts(const Numbers& input, std::size_t width, std::size_t first) {
  std::array<Eigen::Matrix<double, N, 1>, Count> result;
  for (std::size_t i = 0; i < Count; ++i) result[i] = part<N>(input, width * i + first);
  return result;
}
template <int N>
std::vector<Eigen::Matrix<double, N, 1>> all_parts(const Numbers& input, std::size_t width, std::size_t first) {
  std::vector<Eigen::Matrix<double, N, 1>> result;
  for (std::size_t at = first; at + N <= input.size(); at += width) result.push_back(part<N>(input, at));
  return result;
}

void append(Numbers& input, const auto& values) {
  for (Eigen::Index k = 0; k < values.size(); ++k) input.push_back(values(k));
}
template <typename A, typename B>
Numbers pairs(const std::vector<A>& a, const std::vector<B>& b, std::size_t count) {
  Numbers input;
  for (std::size_t i = 0; i < count; ++i) {
    append(input, a[i]);
    append(input, b[i]);
  }
  return input;
}

std::vector<SolverCase> solvers() {
  std::mt19937_64 random(77);
  std::uniform_real_distribution<double> uniform(-1, 1);
  PairSceneOptions turned, plane;
  turned.rotation = rotation_exp<double>({0.1, 0.2, -0.1});
  plane = turned;
  plane.plane = true;
  const PairScene scene(turned, 12, random), flat(plane, 6, random);
  const auto pixels = [](const std::vector<Eigen::Vector3d>& rays) {
    std::vector<Eigen::Vector2d> result;
    for (const Eigen::Vector3d& ray : rays) result.emplace_back(kSceneFocalPx * ray.hnormalized());
    return result;
  };
  std::vector<SolverCase> all;

  Numbers upright = pairs(scene.a, scene.b, 3);
  append(upright, Eigen::Vector3d(Eigen::Vector3d::UnitY()));
  append(upright, Eigen::Vector3d(turned.rotation * Eigen::Vector3d::UnitY()));
  all.push_back(
      {"three points and the vertical", 3, 6, upright, [](const Numbers& n) {
         return solve_vertical_pair(parts<3, 3>(n, 6, 0), parts<3, 3>(n, 6, 3), part<3>(n, 18), part<3>(n, 21)).size();
       }});
  all.push_back({"five points", 5, 6, pairs(scene.a, scene.b, 5),
                 [](const Numbers& n) { return solve_five_point(parts<3, 5>(n, 6, 0), parts<3, 5>(n, 6, 3)).size(); }});
  all.push_back({"seven points", 7, 4, pairs(pixels(scene.a), pixels(scene.b), 7), [](const Numbers& n) {
                   return solve_seven_point(parts<2, 7>(n, 4, 0), parts<2, 7>(n, 4, 2)).size();
                 }});
  all.push_back({"eight points", 8, 4, pairs(pixels(scene.a), pixels(scene.b), 8),
                 [](const Numbers& n) -> std::size_t {
                   return fit_fundamental(all_parts<2>(n, 4, 0), all_parts<2>(n, 4, 2)).has_value();
                 },
                 true});
  all.push_back({"eight rays", 8, 6, pairs(scene.a, scene.b, 8),
                 [](const Numbers& n) -> std::size_t {
                   return fit_essential(all_parts<3>(n, 6, 0), all_parts<3>(n, 6, 3)).has_value();
                 },
                 true});
  all.push_back({"homography of rays", 4, 6, pairs(flat.a, flat.b, 4),
                 [](const Numbers& n) -> std::size_t {
                   return fit_homography(all_parts<3>(n, 6, 0), all_parts<3>(n, 6, 3)).has_value();
                 },
                 true});
  all.push_back({"homography of pixels", 4, 4, pairs(pixels(flat.a), pixels(flat.b), 4),
                 [](const Numbers& n) -> std::size_t {
                   return fit_pixel_homography(all_parts<2>(n, 4, 0), all_parts<2>(n, 4, 2)).has_value();
                 },
                 true});
  all.push_back({"homography of four points", 4, 6, pairs(flat.a, flat.b, 4), [](const Numbers& n) -> std::size_t {
                   return solve_four_point_homography(parts<3, 4>(n, 6, 0), parts<3, 4>(n, 6, 3)).has_value();
                 }});
  all.push_back({"rotation alone", 2, 6, pairs(scene.a, scene.b, 2), [](const Numbers& n) -> std::size_t {
                   return solve_rotation_pair(part<3>(n, 0), part<3>(n, 6), part<3>(n, 3), part<3>(n, 9)).has_value();
                 }});

  std::vector<Eigen::Vector3d> points, origins, directions, to_first, rays;
  for (int i = 0; i < 3; ++i) {
    const double x = uniform(random), y = uniform(random), z = uniform(random);
    points.emplace_back(2 * x, 2 * y, 6 + z);
    rays.push_back(points.back().normalized());
    origins.push_back(0.5 * random_direction(random));
    directions.push_back((points.back() - origins.back()).normalized());
    to_first.push_back((points.front() - origins.back()).normalized());
  }
  all.push_back({"pose of a camera", 3, 6, pairs(rays, points, 3),
                 [](const Numbers& n) { return solve_p3p(parts<3, 3>(n, 6, 0), parts<3, 3>(n, 6, 3)).size(); }});
  Numbers rig;
  for (std::size_t i = 0; i < 3; ++i)
    for (const auto* from : {&origins, &directions, &points}) append(rig, (*from)[i]);
  all.push_back({"pose of a rig", 3, 9, rig, [](const Numbers& n) {
                   return solve_gp3p(parts<3, 3>(n, 9, 0), parts<3, 3>(n, 9, 3), parts<3, 3>(n, 9, 6)).size();
                 }});

  NineParameters image;
  image.rotation = rotation_exp<double>({0.1, -0.2, 1}).toRotationMatrix();
  image.centre = {10, 20, 300};
  image.principal_distance = 5000;
  std::vector<Eigen::Vector3d> ground;
  std::vector<Eigen::Vector2d> seen;
  for (int i = 0; i < 6; ++i) {
    const double x = uniform(random), y = uniform(random), z = uniform(random);
    ground.emplace_back(80 * x, 80 * y, 40 * z);
    seen.push_back(project(image, ground.back()));
  }
  all.push_back({"eleven parameters", 6, 5, pairs(ground, seen, 6),
                 [](const Numbers& n) -> std::size_t {
                   return fit_eleven(all_parts<3>(n, 5, 0), all_parts<2>(n, 5, 3)).has_value();
                 },
                 true});
  all.push_back({"nine parameters", 5, 5, pairs(ground, seen, 5),
                 [image](const Numbers& n) -> std::size_t {
                   return fit_nine(image, all_parts<3>(n, 5, 0), all_parts<2>(n, 5, 3)).has_value();
                 },
                 true});

  all.push_back(
      {"two rays", 2, 6, pairs(origins, to_first, 2), [](const Numbers& n) -> std::size_t {
         return intersect_two_rays({part<3>(n, 0), part<3>(n, 3)}, {part<3>(n, 6), part<3>(n, 9)}).has_value();
       }});
  all.push_back({"any number of rays", 2, 6, pairs(origins, to_first, 2),
                 [](const Numbers& n) -> std::size_t {
                   const auto from = all_parts<3>(n, 6, 0), along = all_parts<3>(n, 6, 3);
                   std::vector<Ray> all_rays;
                   for (std::size_t i = 0; i < from.size(); ++i) all_rays.push_back({from[i], along[i]});
                   return intersect_rays(all_rays).has_value();
                 },
                 true});
  const Similarity similarity{1.5, turned.rotation, {3, -2, 7}};
  std::vector<Eigen::Vector3d> moved;
  for (const Eigen::Vector3d& point : points) moved.push_back(similarity(point));
  all.push_back({"similarity of three points", 3, 6, pairs(points, moved, 3), [](const Numbers& n) -> std::size_t {
                   return solve_similarity(parts<3, 3>(n, 6, 0), parts<3, 3>(n, 6, 3)).has_value();
                 }});
  all.push_back({"similarity, closed form with covariance", 3, 6, pairs(points, moved, 3),
                 [](const Numbers& n) -> std::size_t {
                   const auto from = all_parts<3>(n, 6, 0), to = all_parts<3>(n, 6, 3);
                   const auto found = fit_similarity(from, to);
                   return found && similarity_covariance(*found, from);
                 },
                 true});
  all.push_back({"similarity with errors on both sides", 3, 6, pairs(points, moved, 3),
                 [similarity](const Numbers& n) -> std::size_t {
                   const auto from = all_parts<3>(n, 6, 0), to = all_parts<3>(n, 6, 3);
                   std::vector<PointPair> both;
                   for (std::size_t i = 0; i < from.size(); ++i)
                     both.push_back({from[i], to[i], Eigen::Matrix3d::Identity(), Eigen::Matrix3d::Identity()});
                   return adjust_similarity(similarity, both).has_value();
                 },
                 true});
  return all;
}

TEST(BadInput, ANumberThatIsNone) {
  for (const SolverCase& solver : solvers()) {
    ASSERT_GT(solver.solve(solver.input), 0u) << solver.name;
    for (std::size_t k = 0; k < solver.input.size(); ++k)
      for (const double none : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
        Numbers bad = solver.input;
        bad[k] = none;
        EXPECT_EQ(solver.solve(bad), 0u) << solver.name << ", number " << k << ' ' << none;
      }
  }
}

TEST(BadInput, ACorrespondenceTwice) {
  for (const SolverCase& solver : solvers())
    for (std::size_t i = 0; i < solver.correspondences; ++i)
      for (std::size_t j = 0; j < solver.correspondences; ++j) {
        if (i == j) continue;
        Numbers bad = solver.input;
        std::copy_n(solver.input.begin() + static_cast<std::ptrdiff_t>(i * solver.width), solver.width,
                    bad.begin() + static_cast<std::ptrdiff_t>(j * solver.width));
        EXPECT_EQ(solver.solve(bad), 0u) << solver.name << ", " << i << " in place of " << j;
      }
}

TEST(BadInput, FewerThanNeeded) {
  for (const SolverCase& solver : solvers()) {
    if (!solver.any_number) continue;
    for (std::size_t count = 0; count < solver.correspondences; ++count)
      EXPECT_EQ(solver.solve(Numbers(solver.input.begin(),
                                     solver.input.begin() + static_cast<std::ptrdiff_t>(count * solver.width))),
                0u)
          << solver.name << ", " << count;
  }
}

}  // namespace
}  // namespace megablock
