// Least squares of a relative orientation over many matches, with covariance, from a start that is near; residuals and
// unknowns are those of sampson.h.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <numbers>
#include <span>
#include <vector>

#include "geometry/two_view/point_pairs.h"
#include "geometry/two_view/sampson.h"

namespace megablock {

// By w and along axes_across of the base, as above.
Eigen::Matrix<double, 5, 1> sampson_derivative(const RelativeOrientation& orientation, const Eigen::Vector2d& a,
                                               const Eigen::Vector2d& b);

// Angle between the two rays of a match, radians.
double intersection_angle(const Eigen::Quaterniond& rotation, const Eigen::Vector2d& a, const Eigen::Vector2d& b);

struct RelativeAdjustment {
  double scale = 1e-3;        // of the Geman-McClure weights 1 / (1 + (r / scale)^2)^2, normalised units
  int max_iterations = 30;    // of Levenberg-Marquardt; ends earlier with a step below the tolerance
  std::size_t max_pairs = 0;  // at most so many of them, evenly taken from all; 0: all
  double tolerance = 1e-9;    // radians
};

// From a start near enough: the minimum of the weighted squares. `weights` [pairs], besides those of the residuals;
// empty: all one.
RelativeOrientation adjust_orientation(const RelativeOrientation& start, const PointPairs& points,
                                       const RelativeAdjustment& by, std::span<const double> weights = {});

// Weights that bound what a single pair decides (C. Mallows 1975; F. Hampel et al., "Robust statistics", 1986, 6.3):
// one where the leverage J' N^-1 J of an inlier is at most three times the median, beyond it in inverse proportion to
// it; zero of what is no inlier. A wrong match has any parallax, and turns the base the more the larger it is: of 150
// right matches and a wrong one with ten times their parallax that one decides.
std::vector<double> leverage_weights(const RelativeOrientation& orientation, const PointPairs& points,
                                     std::span<const std::uint8_t> inlier);

// Of w (3) and the base along axes_across (2), radians. Where the pairs leave a direction open its sigma is pi.
struct OrientationPrecision {
  Eigen::Matrix<double, 5, 5> covariance =
      std::numbers::pi * std::numbers::pi * Eigen::Matrix<double, 5, 5>::Identity();
  double sigma = 0;  // of an image coordinate, as the covariance has it; normalised units
  // Largest over the directions, radians.
  double rotation_sigma() const;
  double base_sigma() const;
};

// Of an orientation adjusted with this scale of the weights, and these further ones (empty: all one), to the pairs that
// are inliers: weights cost accuracy, wrong matches among the inliers cost more. With psi = r / (1 + (r / scale)^2)^2
// sigma^2 is mean(psi^2) / mean(psi')^2 (P. Huber, "Robust statistics", 1981, 7.6), at least `min_sigma` squared:
// matches are never exact. What the points' own errors add to the parallaxes is taken from them, so that without a base
// it is open. Where that leaves the base worse than half a degree, the covariance is that of open_base.h, if there is
// one. Six inliers at least, else all is open.
OrientationPrecision precision_of(const RelativeOrientation& orientation, const PointPairs& points,
                                  std::span<const std::uint8_t> inlier, double scale, double min_sigma,
                                  std::span<const double> weights = {});

// The same of a rotation alone, of unit rays b ~ R a; the base is open. Two rays at least, else all is.
OrientationPrecision precision_of_rotation(const Eigen::Quaterniond& rotation, std::span<const Eigen::Vector3d> a,
                                           std::span<const Eigen::Vector3d> b, double min_sigma);

}  // namespace megablock
