// The cost of a proposed point X is that of MSAC, sum over the rays of min(r_i(X)^2, t^2), with r_i the length of the
// residual of ray i in sigmas and t the threshold. In contrast to a count of inliers it prefers the better of two
// points with the same number of rays (P. Torr and A. Zisserman, "MLESAC", CVIU 78, 2000).
#include "adjust/tile/consistent_rays.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <utility>

namespace megablock {

namespace {

constexpr std::size_t kMaxPairs = 36;  // all pairs of nine rays
// Times the threshold, because a point of two rays is less exact than one of all rays.
constexpr double kTwoRayFactor = 1.5;

// All pairs of rays, or a fixed number of them where there are many.
std::vector<std::pair<std::size_t, std::size_t>> pairs_of(std::size_t rays, std::uint64_t seed) {
  std::vector<std::pair<std::size_t, std::size_t>> result;
  if (rays * (rays - 1) / 2 <= kMaxPairs) {
    for (std::size_t a = 0; a < rays; ++a)
      for (std::size_t b = a + 1; b < rays; ++b) result.emplace_back(a, b);
    return result;
  }
  // The seed is the number of the point, so that the pairs do not depend on the order or the thread in which points
  // come.
  std::mt19937_64 random(seed);
  while (result.size() < kMaxPairs) {
    const std::size_t a = random() % rays, b = random() % rays;
    if (a != b) result.emplace_back(a, b);
  }
  return result;
}

double truncated_cost(std::span<const PointView> views, const Eigen::Vector3d& point, double threshold) {
  const double most = threshold * threshold;
  double sum = 0;
  for (const PointView& view : views) {
    const double r = residual_sigmas(view, point);
    sum += std::min(r * r, most);
  }
  return sum;
}

// Refines the point with the rays that pass, until these rays no longer change.
std::optional<ConsistentRays> refine_part(std::span<const PointView> views, Eigen::Vector3d point, double threshold) {
  constexpr int kRounds = 4;
  std::vector<std::uint8_t> passing(views.size()), before;
  for (int round = 0; round < kRounds; ++round) {
    std::vector<PointView> used;
    for (std::size_t i = 0; i < views.size(); ++i) {
      // The proposal comes from two rays and has their errors. In the first round rays pass somewhat beyond the
      // threshold.
      passing[i] = residual_sigmas(views[i], point) <= (round == 0 ? kTwoRayFactor * threshold : threshold);
      if (passing[i]) used.push_back(views[i]);
    }
    if (used.size() < 2) return std::nullopt;
    if (round > 0 && passing == before) break;
    const auto refined = refine_point(point, used);
    if (!refined) return std::nullopt;
    point = refined->position;
    before = passing;
  }
  for (std::size_t i = 0; i < views.size(); ++i)
    passing[i] = passing[i] && residual_sigmas(views[i], point) <= threshold;
  if (std::count(passing.begin(), passing.end(), 1) < 2) return std::nullopt;
  return ConsistentRays{point, passing};
}

}  // namespace

double residual_sigmas(const PointView& view, const Eigen::Vector3d& point) {
  const double length =
      view.inverse_sigma * reprojection(*view.intrinsics, to_inside(view.camera, point), view.pixel).norm();
  return std::isfinite(length) ? length : std::numeric_limits<double>::infinity();
}

std::optional<ConsistentRays> find_consistent_rays(std::span<const PointView> views, double threshold,
                                                   std::uint64_t seed) {
  if (views.size() < 2) return std::nullopt;
  std::vector<std::optional<Ray>> rays;
  for (const PointView& view : views) rays.push_back(ground_ray(view.camera, *view.intrinsics, view.pixel));
  std::optional<Eigen::Vector3d> best;
  double best_cost = std::numeric_limits<double>::infinity();
  for (const auto& [a, b] : pairs_of(views.size(), seed)) {
    if (!rays[a] || !rays[b]) continue;
    const std::array<Ray, 2> two{*rays[a], *rays[b]};
    const auto point = intersect_rays(two);
    if (!point) continue;
    const double cost = truncated_cost(views, *point, threshold);
    if (cost < best_cost) best_cost = cost, best = point;
  }
  return best ? refine_part(views, *best, threshold) : std::nullopt;
}

bool meet_wider_than(std::span<const PointView> views, const std::vector<std::uint8_t>& used,
                     const Eigen::Vector3d& point, double cos_angle) {
  std::vector<Eigen::Vector3d> directions;
  for (std::size_t i = 0; i < views.size(); ++i) {
    if (!used[i]) continue;
    const Eigen::Vector3d direction = (point - views[i].camera.centre).normalized();
    for (const Eigen::Vector3d& other : directions)
      if (direction.dot(other) <= cos_angle) return true;
    directions.push_back(direction);
  }
  return false;
}

}  // namespace megablock
