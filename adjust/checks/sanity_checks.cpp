// Makes two checks by numbers without unit. For a strip, with the centres on their principal axis at the abscissae a_i,
// `off_line` is the largest distance from the axis and `uneven` the largest |(a_i - a_{i-1}) / spacing - 1|. For a
// level scene, the distances of the points from the plane of most points are divided into two groups with the least
// scatter within them (N. Otsu, 1979). Their separation is the difference of the means over the rms of the two standard
// deviations.
#include "adjust/checks/sanity_checks.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "geometry/numbers/decompositions.h"

namespace megablock {

namespace {

// Finds the plane through three of the points that is nearest to three tenths of all points. Of two levels with half of
// the points each it finds one.
struct Plane {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
  double offset = 0;
  double distance(const Eigen::Vector3d& point) const { return normal.dot(point) - offset; }
};
Plane plane_of_most(const std::vector<Eigen::Vector3d>& points) {
  constexpr int kDraws = 500;
  std::mt19937_64 random(points.size());
  Plane best;
  double least = std::numeric_limits<double>::infinity();
  std::vector<double> distances(points.size());
  for (int draw = 0; draw < kDraws; ++draw) {
    const auto pick = [&]() -> const Eigen::Vector3d& { return points[random() % points.size()]; };
    const Eigen::Vector3d &a = pick(), &b = pick(), &c = pick();
    const Eigen::Vector3d across = (b - a).cross(c - a);
    if (!(across.norm() > 1e-3 * (b - a).norm() * (c - a).norm()) || across.isZero(0)) continue;
    Plane plane{across.normalized(), 0};
    plane.offset = plane.normal.dot(a);
    for (std::size_t i = 0; i < points.size(); ++i) distances[i] = std::abs(plane.distance(points[i]));
    // Three tenths and not one half: with two levels of half of the points each, the median distance from the plane of
    // one level may be that of a point of the other.
    const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(3 * distances.size() / 10);
    std::nth_element(distances.begin(), middle, distances.end());
    if (*middle < least) {
      least = *middle;
      best = plane;
    }
  }
  return best;
}

}  // namespace

StripCheck check_strip(const std::vector<Eigen::Vector3d>& centres) {
  StripCheck check;
  if (centres.size() < 3) return check;
  constexpr double kInfinite = std::numeric_limits<double>::infinity();
  for (const Eigen::Vector3d& c : centres)
    if (!c.allFinite()) return {kInfinite, kInfinite};
  const auto count = static_cast<double>(centres.size());
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& c : centres) mean += c / count;
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& c : centres) scatter += (c - mean) * (c - mean).transpose();
  const Eigen::Vector3d direction = symmetric_eigen(scatter).vectors.col(2);
  std::vector<double> along;
  double farthest = 0;
  for (const Eigen::Vector3d& c : centres) {
    along.push_back(direction.dot(c - mean));
    farthest = std::max(farthest, (c - mean - along.back() * direction).norm());
  }
  // The mean spacing has the sign of the direction of travel along the axis.
  const double spacing = (along.back() - along.front()) / (count - 1);
  if (spacing == 0) return {kInfinite, kInfinite};
  check.off_line = farthest / std::abs(spacing);
  for (std::size_t i = 1; i < along.size(); ++i)
    check.uneven = std::max(check.uneven, std::abs((along[i] - along[i - 1]) / spacing - 1));
  return check;
}

bool LevelCheck::sound() const {
  constexpr double kFewest = 0.05;
  return separation <= kLimit || smaller_share < kFewest;
}

LevelCheck check_one_level(const std::vector<Eigen::Vector3d>& given) {
  LevelCheck check;
  std::vector<Eigen::Vector3d> points;
  for (const Eigen::Vector3d& point : given)
    if (point.allFinite()) points.push_back(point);
  constexpr std::size_t kFewest = 10;
  if (points.size() < kFewest) return check;
  const Plane plane = plane_of_most(points);
  std::vector<double> heights;
  for (const Eigen::Vector3d& p : points) heights.push_back(plane.distance(p));
  std::sort(heights.begin(), heights.end());

  // The division into two groups with the least scatter within them (Otsu).
  const auto count = static_cast<double>(heights.size());
  // Sums of the sorted values give means and scatters of both groups for every division in one run.
  double sum = 0, squares = 0;
  for (double h : heights) sum += h, squares += h * h;
  double below = 0, below_squares = 0, least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 1; i < heights.size(); ++i) {
    below += heights[i - 1];
    below_squares += heights[i - 1] * heights[i - 1];
    const auto n = static_cast<double>(i);
    const double low = below / n, high = (sum - below) / (count - n);
    const double low_scatter = below_squares - n * low * low,
                 high_scatter = squares - below_squares - (count - n) * high * high;
    if (low_scatter + high_scatter >= least) continue;
    least = low_scatter + high_scatter;
    check.step = high - low;
    check.smaller_share = std::min(n, count - n) / count;
    const double within = 0.5 * (std::max(0.0, low_scatter) / n + std::max(0.0, high_scatter) / (count - n));
    check.separation = check.step > 0 ? check.step / std::sqrt(within) : 0;  // infinite when there is no scatter
  }
  return check;
}

}  // namespace megablock
