// Gives the estimators that ransac.h uses for pairs of images. Points are normalised image points (X/Z, Y/Z), so
// residuals are in units of the focal length, and one residual component has the standard deviation of an image
// coordinate.
//
//     FivePointEstimator      relative orientation        5 matches   Sampson distance, points in front of both
//     VerticalPairEstimator   the same, verticals known   3 matches   the same; refined with free verticals
//     HomographyEstimator     plane, x_b ~ H x_a          4 matches   distance in b
//     RotationPairEstimator   one centre, x_b ~ R x_a     2 matches   distance in b
//     FundamentalEstimator    not calibrated              7 matches   Sampson distance
//
// An outlier is taken to lie anywhere in the bounding box of the points of b. The estimators keep references to the
// points.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <optional>

#include "geometry/two_view/point_pairs.h"
#include "geometry/two_view/relative_orientation.h"

namespace megablock {

// Share of the image of b that lies within a distance of a line or of a point: the probability that an outlier agrees
// with a model.
class ImageShares {
 public:
  explicit ImageShares(const PointPairs& points);
  // A match with the Sampson distance r is at most sqrt(2) r away from its epipolar line; the limit is reached where
  // both images contribute equally. The line is taken as long as the diagonal.
  double near_line(double sampson) const;
  double near_point(double distance) const;

 private:
  double area_ = 0, diagonal_ = 0;
};

// Common part of the estimators for five points and for three points with verticals.
class OrientationEstimator {
 public:
  using Model = RelativeOrientation;
  // `parallel` (radians) is the threshold of the residuals, or the largest one: points whose rays are closer to
  // parallel count as in front, because errors decide their sign. `spacing` is the least distance in image a between
  // points of a sample.
  OrientationEstimator(const PointPairs& points, double parallel, double spacing = 0)
      : points_(&points), shares_(points), parallel_(parallel), spacing_(spacing) {}
  std::size_t size() const { return points_->size(); }
  double chance(double residual) const { return shares_.near_line(residual); }

  // Squared Sampson distance; infinite for a point behind an image. The depth test is left out where the residual alone
  // excludes the point.
  struct Residuals {
    const PointPairs& points;
    Eigen::Matrix3d essential, rotation;
    Eigen::Vector3d base;
    double limit;  // parallel^2; above it the depths are not tested
    double operator()(std::size_t i) const;
  };
  Residuals squared_residuals(const RelativeOrientation& o) const;
  std::optional<RelativeOrientation> refine(const RelativeOrientation& o, double threshold) const;
  bool apart(std::size_t i, std::size_t j) const {
    return !(spacing_ > 0) || (points_->a[i] - points_->a[j]).squaredNorm() >= spacing_ * spacing_;
  }

 protected:
  Eigen::Vector3d ray_a(std::size_t i) const { return points_->a[i].homogeneous().normalized(); }
  Eigen::Vector3d ray_b(std::size_t i) const { return points_->b[i].homogeneous().normalized(); }

 private:
  const PointPairs* points_;
  ImageShares shares_;
  double parallel_, spacing_;
};

class FivePointEstimator : public OrientationEstimator {
 public:
  static constexpr std::size_t kSampleSize = 5;
  using OrientationEstimator::OrientationEstimator;
  Solutions<RelativeOrientation, 10> solve(const std::array<std::size_t, 5>& rows) const;
};

class VerticalPairEstimator : public OrientationEstimator {
 public:
  static constexpr std::size_t kSampleSize = 3;
  // Unit vectors in camera axes, both up or both down.
  VerticalPairEstimator(const PointPairs& points, double parallel, const Eigen::Vector3d& vertical_a,
                        const Eigen::Vector3d& vertical_b, double spacing = 0)
      : OrientationEstimator(points, parallel, spacing), vertical_a_(vertical_a), vertical_b_(vertical_b) {}
  Solutions<RelativeOrientation, 4> solve(const std::array<std::size_t, 3>& rows) const;

 private:
  Eigen::Vector3d vertical_a_, vertical_b_;
};

class HomographyEstimator {
 public:
  using Model = Eigen::Matrix3d;
  static constexpr std::size_t kSampleSize = 4;
  explicit HomographyEstimator(const PointPairs& points) : points_(&points), shares_(points) {}
  std::size_t size() const { return points_->size(); }
  double chance(double residual) const { return shares_.near_point(residual); }
  Solutions<Eigen::Matrix3d, 1> solve(const std::array<std::size_t, 4>& rows) const;
  struct Residuals {
    const PointPairs& points;
    Eigen::Matrix3d homography;
    double operator()(std::size_t i) const;
  };
  Residuals squared_residuals(const Eigen::Matrix3d& h) const { return {*points_, h}; }
  // Least squares over inliers, by fit_homography: of rays, scaled as there.
  std::optional<Eigen::Matrix3d> refine(const Eigen::Matrix3d& h, double threshold) const;

 private:
  const PointPairs* points_;
  ImageShares shares_;
};

class RotationPairEstimator {
 public:
  using Model = Eigen::Quaterniond;
  static constexpr std::size_t kSampleSize = 2;
  explicit RotationPairEstimator(const PointPairs& points) : points_(&points), shares_(points) {}
  std::size_t size() const { return points_->size(); }
  double chance(double residual) const { return shares_.near_point(residual); }
  Solutions<Eigen::Quaterniond, 1> solve(const std::array<std::size_t, 2>& rows) const;
  HomographyEstimator::Residuals squared_residuals(const Eigen::Quaterniond& q) const {
    return {*points_, q.toRotationMatrix()};
  }
  std::optional<Eigen::Quaterniond> refine(const Eigen::Quaterniond& q, double threshold) const;

 private:
  const PointPairs* points_;
  ImageShares shares_;
};

class FundamentalEstimator {
 public:
  using Model = Eigen::Matrix3d;
  static constexpr std::size_t kSampleSize = 7;
  explicit FundamentalEstimator(const PointPairs& points) : points_(&points), shares_(points) {}
  std::size_t size() const { return points_->size(); }
  double chance(double residual) const { return shares_.near_line(residual); }
  Solutions<Eigen::Matrix3d, 3> solve(const std::array<std::size_t, 7>& rows) const;
  struct Residuals {
    const PointPairs& points;
    Eigen::Matrix3d fundamental;
    double operator()(std::size_t i) const;
  };
  Residuals squared_residuals(const Eigen::Matrix3d& f) const { return {*points_, f}; }
  std::optional<Eigen::Matrix3d> refine(const Eigen::Matrix3d& f, double threshold) const;

 private:
  const PointPairs* points_;
  ImageShares shares_;
};

// Squared Sampson distance of a match: n^2 / d with n = b' E a and d the sum of the squared first two elements of E a
// and E' b. The matrix may be essential or fundamental.
inline double squared_sampson(const Eigen::Matrix3d& e, const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  const double bx = e(0, 0) * a.x() + e(0, 1) * a.y() + e(0, 2), by = e(1, 0) * a.x() + e(1, 1) * a.y() + e(1, 2),
               bz = e(2, 0) * a.x() + e(2, 1) * a.y() + e(2, 2);
  const double ax = e(0, 0) * b.x() + e(1, 0) * b.y() + e(2, 0), ay = e(0, 1) * b.x() + e(1, 1) * b.y() + e(2, 1);
  const double n = b.x() * bx + b.y() * by + bz;
  return n * n / (bx * bx + by * by + ax * ax + ay * ay);
}

inline double OrientationEstimator::Residuals::operator()(std::size_t i) const {
  const Eigen::Vector2d &a = points.a[i], &b = points.b[i];
  const double r2 = squared_sampson(essential, a, b);
  if (!(r2 <= limit)) return r2;
  const Eigen::Vector3d ray_a = a.homogeneous(), ray_b = b.homogeneous();
  const ScaledDepths depths = scaled_depths(rotation, base, ray_a, ray_b);
  const bool in_front =
      (depths.a > 0 && depths.b > 0) || depths.sine_squared < limit * ray_a.squaredNorm() * ray_b.squaredNorm();
  return in_front ? r2 : std::numeric_limits<double>::infinity();
}

inline double HomographyEstimator::Residuals::operator()(std::size_t i) const {
  const Eigen::Vector2d& a = points.a[i];
  const Eigen::Vector3d moved = homography * a.homogeneous();
  if (!(moved.z() > 0)) return std::numeric_limits<double>::infinity();
  return (moved.hnormalized() - points.b[i]).squaredNorm();
}

inline double FundamentalEstimator::Residuals::operator()(std::size_t i) const {
  return squared_sampson(fundamental, points.a[i], points.b[i]);
}

}  // namespace megablock
