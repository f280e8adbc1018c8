// Adjusts a relative orientation to many matches, by robust least squares, and gives its covariance. It needs a good
// approximation, such as the result of RANSAC. Residuals and unknowns are those of sampson.h: the Sampson distance in
// normalised image coordinates, the increment w of the rotation, and the base along two axes across it.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <numbers>
#include <span>
#include <vector>

#include "geometry/two_view/point_pairs.h"
#include "geometry/two_view/sampson.h"

namespace megablock {

// Derivative of the Sampson residual of a match by w (3) and along axes_across of the base (2). Zero where the residual
// is not defined.
Eigen::Matrix<double, 5, 1> sampson_derivative(const RelativeOrientation& orientation, const Eigen::Vector2d& a,
                                               const Eigen::Vector2d& b);

// Angle between the two rays of a match, radians in [0, pi].
double intersection_angle(const Eigen::Quaterniond& rotation, const Eigen::Vector2d& a, const Eigen::Vector2d& b);

struct RelativeAdjustment {
  double scale = 1e-3;        // s of the Geman-McClure weights 1 / (1 + (r / s)^2)^2, in normalised units
  int max_iterations = 30;    // iterations of Levenberg-Marquardt; fewer if a step is below the tolerance
  std::size_t max_pairs = 0;  // largest number of pairs used, evenly spaced; 0: all
  double tolerance = 1e-9;    // length of the last step, radians
};

// Minimises the robust cost from the approximation `start` and returns the orientation. `weights` (one per pair, empty:
// equal) multiply the robust weights.
RelativeOrientation adjust_orientation(const RelativeOrientation& start, const PointPairs& points,
                                       const RelativeAdjustment& by, std::span<const double> weights = {});

// Weights that bound the influence of a single pair (C. Mallows 1975; F. Hampel et al., "Robust statistics", 1986,
// section 6.3). The leverage of a pair is J' N^-1 J, with its derivative J and the normal matrix N. Returns 1 for an
// inlier whose leverage is at most three times the median, less in inverse proportion beyond, and 0 for an outlier.
//
// Why: an undetected wrong match has an arbitrary parallax, and the larger its parallax, the more it turns the base.
// Among 150 right matches, one wrong match with ten times their parallax would decide the base alone.
std::vector<double> leverage_weights(const RelativeOrientation& orientation, const PointPairs& points,
                                     std::span<const std::uint8_t> inlier);

// Covariance of w (3) and of the base along axes_across (2), radians. A direction that the pairs do not determine has a
// standard deviation of pi.
struct OrientationPrecision {
  Eigen::Matrix<double, 5, 5> covariance =
      std::numbers::pi * std::numbers::pi * Eigen::Matrix<double, 5, 5>::Identity();
  double sigma = 0;  // standard deviation of an image coordinate, normalised units
  // Largest standard deviation over all directions, radians.
  double rotation_sigma() const;
  double base_sigma() const;
};

// Precision of an orientation that was adjusted to the inliers with this `scale` and these `weights` (empty: equal).
//
// With psi(r) = r / (1 + (r / scale)^2)^2, sigma^2 is mean(psi^2) / mean(psi')^2 (P. Huber, "Robust statistics", 1981,
// section 7.6), at least `min_sigma`^2, as matches are never exact.
//
// The parallax that determines the base also contains the errors of the points. Their share is subtracted from the
// normal matrix; without this correction, a pair with no base at all would seem to have a determined one. Where the
// base then has a standard deviation above half a degree, the covariance is that of open_base.h, if it has one. Fewer
// than six inliers leave all directions undetermined.
OrientationPrecision precision_of(const RelativeOrientation& orientation, const PointPairs& points,
                                  std::span<const std::uint8_t> inlier, double scale, double min_sigma,
                                  std::span<const double> weights = {});

// The same for a rotation without base, from unit rays b ~ R a; the base is undetermined. With fewer than two rays
// everything is.
OrientationPrecision precision_of_rotation(const Eigen::Quaterniond& rotation, std::span<const Eigen::Vector3d> a,
                                           std::span<const Eigen::Vector3d> b, double min_sigma);

}  // namespace megablock
