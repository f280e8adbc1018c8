// Covariance of a relative orientation whose base is hardly determined: from the cost itself instead of its curvature.
//
// Where all points lie on a plane and the base runs along its normal, first derivatives say nothing. To exchange base
// and normal leaves the matches as they are, so that they determine u = z^2 only, z the base's offset from the middle
// of the two as a complex number: an error of u by s is one of sqrt(s) in the base, and the curvature 4 |u| tells only
// how far the estimate happens to be from the plane's other orientation. With the cost of relative_adjustment.h,
//
//     D(t) = min_R C(R, t) - C(estimate),    C = sum w r^2 / (1 + r^2/s^2) / (kappa sigma^2),
//
// kappa the mean slope of its influence function and sigma as precision_of has it. D is no likelihood: a residual is
// the component along m (r's derivative by the four coordinates, unit) of the match's error, and m turns with t, most
// near the epipole. So errors add sums of their products to D, and the estimate is where these happen to be least.
// Where a match that satisfies the estimate, corrected by -r m, has the residual r0(t), let
//
//     S + K = min_R sum w r0(t)^2 / sigma^2,    K = (sum w k + 4 (2 sum w^2 k^2)^1/2) sigma_x^2 / sigma^2,
//     k = 1 - (m(t) . m(estimate))^2,           sigma_x^2 = sum w (r / (1 + r^2/s^2))^2 / (kappa (sum w - 5)):
//
// what tells t from the estimate, and what the errors' turning adds, with four of its standard deviations, as the
// estimate has chosen the least of many (with two, one of 150 pairs along a normal was beyond 3 sigmas); sigma_x is
// that of an image coordinate alone. D has the mean S where the estimate is the truth, -S where t is, and the variance
// 4 (S + K) in both; so the logarithm of the odds of t against the estimate is
//
//     -1/2 D S / (S + K),
//
// nothing without a base, where S = 0, and that of least squares where base and parallaxes are well above the errors.
// The covariance is the second moment of (R(t), t) about the estimate over these odds, as its error is what counts, and
// that of the rotation with the base held. The sum over t is along rays from the estimate, in units in which the
// exponent rises to about one half. A ray ends where next to nothing is left: what lies behind a barrier is the twin's
// affair. On a ray the rotation follows the base by linear prediction and a step of Gauss and Newton: a place is one
// pass over the matches, a covariance some sixty.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "geometry/two_view/point_pairs.h"
#include "geometry/two_view/relative_orientation.h"

namespace megablock {

struct BaseCost {
  double scale = 0;     // s
  double slope = 0;     // kappa
  double variance = 0;  // sigma^2
};

// Of w and the base along axes_across (sampson.h). `linear`: about the covariance of the base, to begin with. `weights`
// [pairs]: w. Empty where the matches leave the base open, or the estimate is no minimum.
std::optional<Eigen::Matrix<double, 5, 5>> covariance_of_open_base(const RelativeOrientation& estimate,
                                                                   const Eigen::Matrix2d& linear,
                                                                   const PointPairs& points,
                                                                   std::span<const double> weights,
                                                                   const BaseCost& cost);

}  // namespace megablock
