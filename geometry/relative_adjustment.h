// Least squares of a relative orientation over many matches, with covariance, from a start that is near. Residuals are
// those of P. D. Sampson, "Fitting conic sections to 'very scattered' data", CGIP 18, 1982.
//
//     E = [t]x R,  n = x_b' E x_a,  d = |(E x_a)_{1,2}|^2 + |(E' x_b)_{1,2}|^2,  r = n / sqrt(d)   (Sampson)
//
// for normalised image points x (X/Z, Y/Z, 1). r is the distance of the match from the nearest one that satisfies the
// coplanarity equation, to first order; its standard deviation is that of an image coordinate. Unknowns: increment w of
// the rotation, R Exp(w) (rotation.h), and the base t on the unit sphere, along two axes p across it. With u = R x_a,
// the epipolar lines l_b = E x_a and l_a = E' x_b, and l' the vectors with a zero as third component
//
//     dn/dw = x_a x l_a,        (dd/dw)/2 = x_a x E' l_b' + l_a' x l_a,
//     dn/dp = p . (u x x_b),    (dd/dp)/2 = p . (u x l_b' - x_b x R l_a').
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <span>
#include <vector>

#include "geometry/point_pairs.h"
#include "geometry/relative_orientation.h"

namespace megablock {

inline double sampson_residual(const Eigen::Matrix3d& essential, const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  const Eigen::Vector3d line_b = essential * a.homogeneous(), line_a = essential.transpose() * b.homogeneous();
  const double d = line_b.head<2>().squaredNorm() + line_a.head<2>().squaredNorm();
  return b.homogeneous().dot(line_b) / std::sqrt(d);
}

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

// Two unit axes across the base.
Eigen::Matrix<double, 3, 2> axes_across(const Eigen::Vector3d& base);

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
// it is open. Six inliers at least, else all is.
OrientationPrecision precision_of(const RelativeOrientation& orientation, const PointPairs& points,
                                  std::span<const std::uint8_t> inlier, double scale, double min_sigma,
                                  std::span<const double> weights = {});

// The same of a rotation alone, of unit rays b ~ R a; the base is open. Two rays at least, else all is.
OrientationPrecision precision_of_rotation(const Eigen::Quaterniond& rotation, std::span<const Eigen::Vector3d> a,
                                           std::span<const Eigen::Vector3d> b, double min_sigma);

}  // namespace megablock
