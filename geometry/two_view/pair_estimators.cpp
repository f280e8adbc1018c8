#include "geometry/two_view/pair_estimators.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>

#include "geometry/transform/rotation_fit.h"
#include "geometry/two_view/five_point.h"
#include "geometry/two_view/fundamental.h"
#include "geometry/two_view/homography.h"
#include "geometry/two_view/relative_adjustment.h"
#include "geometry/two_view/rotation_pair.h"
#include "geometry/two_view/vertical_pair.h"

namespace megablock {

namespace {

// Largest number of pairs in a local optimisation. It keeps its cost at that of a few draws; the loss of accuracy is
// small against the threshold.
constexpr std::size_t kLocalPairs = 128;

// A selection of inliers, evenly spaced, held in place.
template <typename Vector>
struct LocalPairs {
  std::array<Vector, kLocalPairs> a, b;
  std::size_t count = 0;
  std::span<const Vector> first() const { return {a.data(), count}; }
  std::span<const Vector> second() const { return {b.data(), count}; }
};

template <typename Vector, typename Residuals, typename MakeVector>
LocalPairs<Vector> local_pairs(const PointPairs& points, const Residuals& squared_residual, double threshold,
                               const MakeVector& vector_of) {
  const double limit = threshold * threshold;
  std::size_t inliers = 0;
  for (std::size_t i = 0; i < points.size(); ++i) inliers += squared_residual(i) <= limit;
  const std::size_t stride = std::max<std::size_t>(1, (inliers + kLocalPairs - 1) / kLocalPairs);
  LocalPairs<Vector> pairs;
  for (std::size_t i = 0, k = 0; i < points.size(); ++i) {
    if (!(squared_residual(i) <= limit) || k++ % stride != 0) continue;
    pairs.a[pairs.count] = vector_of(points.a[i]);
    pairs.b[pairs.count++] = vector_of(points.b[i]);
  }
  return pairs;
}

Eigen::Vector3d ray_of(const Eigen::Vector2d& p) { return p.homogeneous().normalized(); }

}  // namespace

ImageShares::ImageShares(const PointPairs& points) {
  Eigen::AlignedBox2d box;
  for (const Eigen::Vector2d& p : points.b)
    if (p.allFinite()) box.extend(p);
  if (box.isEmpty()) return;
  area_ = box.sizes().prod();
  diagonal_ = box.sizes().norm();
}

double ImageShares::near_line(double sampson) const {
  const double band = 2 * std::numbers::sqrt2 * sampson * diagonal_;
  return band < area_ ? band / area_ : 1;
}

double ImageShares::near_point(double distance) const {
  const double disc = std::numbers::pi * distance * distance;
  return disc < area_ ? disc / area_ : 1;
}

OrientationEstimator::Residuals OrientationEstimator::squared_residuals(const RelativeOrientation& o) const {
  const Eigen::Matrix3d rotation = o.rotation.toRotationMatrix();
  return {*points_, skew<double>(o.base) * rotation, rotation, o.base, parallel_ * parallel_};
}

std::optional<RelativeOrientation> OrientationEstimator::refine(const RelativeOrientation& o, double threshold) const {
  constexpr int kIterations = 4;
  return adjust_orientation(o, *points_, {0.5 * threshold, kIterations, 2 * kLocalPairs});
}

Solutions<RelativeOrientation, 10> FivePointEstimator::solve(const std::array<std::size_t, 5>& rows) const {
  FiveRays a, b;
  for (std::size_t k = 0; k < 5; ++k) {
    a[k] = ray_a(rows[k]);
    b[k] = ray_b(rows[k]);
  }
  return solve_five_point_in_front(a, b);
}

Solutions<RelativeOrientation, 4> VerticalPairEstimator::solve(const std::array<std::size_t, 3>& rows) const {
  std::array<Eigen::Vector3d, 3> a, b;
  for (std::size_t k = 0; k < 3; ++k) {
    a[k] = ray_a(rows[k]);
    b[k] = ray_b(rows[k]);
  }
  return solve_vertical_pair(a, b, vertical_a_, vertical_b_);
}

Solutions<Eigen::Matrix3d, 1> HomographyEstimator::solve(const std::array<std::size_t, 4>& rows) const {
  std::array<Eigen::Vector3d, 4> a, b;
  for (std::size_t k = 0; k < 4; ++k) {
    a[k] = points_->a[rows[k]].homogeneous();
    b[k] = points_->b[rows[k]].homogeneous();
  }
  Solutions<Eigen::Matrix3d, 1> found;
  if (const auto h = solve_four_point_homography(a, b)) found.push_back(*h);
  return found;
}

std::optional<Eigen::Matrix3d> HomographyEstimator::refine(const Eigen::Matrix3d& h, double threshold) const {
  const auto pairs = local_pairs<Eigen::Vector3d>(*points_, squared_residuals(h), threshold, ray_of);
  return fit_homography(pairs.first(), pairs.second());
}

Solutions<Eigen::Quaterniond, 1> RotationPairEstimator::solve(const std::array<std::size_t, 2>& rows) const {
  Solutions<Eigen::Quaterniond, 1> found;
  if (const auto q = solve_rotation_pair(ray_of(points_->a[rows[0]]), ray_of(points_->a[rows[1]]),
                                         ray_of(points_->b[rows[0]]), ray_of(points_->b[rows[1]])))
    found.push_back(*q);
  return found;
}

std::optional<Eigen::Quaterniond> RotationPairEstimator::refine(const Eigen::Quaterniond& q, double threshold) const {
  const auto pairs = local_pairs<Eigen::Vector3d>(*points_, squared_residuals(q), threshold, ray_of);
  return fit_rotation(pairs.first(), pairs.second());
}

Solutions<Eigen::Matrix3d, 3> FundamentalEstimator::solve(const std::array<std::size_t, 7>& rows) const {
  std::array<Eigen::Vector2d, 7> a, b;
  for (std::size_t k = 0; k < 7; ++k) {
    a[k] = points_->a[rows[k]];
    b[k] = points_->b[rows[k]];
  }
  return solve_seven_point(a, b);
}

std::optional<Eigen::Matrix3d> FundamentalEstimator::refine(const Eigen::Matrix3d& f, double threshold) const {
  const auto pairs = local_pairs<Eigen::Vector2d>(*points_, squared_residuals(f), threshold,
                                                  [](const Eigen::Vector2d& p) { return p; });
  return fit_fundamental(pairs.first(), pairs.second());
}

}  // namespace megablock
