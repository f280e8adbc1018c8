// Gives the covariance of a relative orientation whose base is hardly determined. It comes from the cost itself,
// because the curvature of the cost at the estimate does not describe such a base.
//
// The critical case is a plane that is seen with the base along its normal. To exchange base and normal leaves the
// observations unchanged. Let z be the offset of the base from the middle between the two, as a complex number in the
// tangent plane; then the observations determine only u = z^2. An error s of u makes an error sqrt(s) of the base, and
// the curvature 4 |u| says only how far the estimate happens to be from the plane's other orientation. So this file
// looks at the cost of relative_adjustment.h as a function of the base t, with the best rotation for each t:
//
//     D(t) = min_R C(R, t) - C(estimate),    C = sum w r^2 / (1 + r^2/s^2) / (kappa sigma^2),
//
// Here kappa is the mean slope of the influence function, and sigma is estimated as in precision_of().
//
// D is not a log-likelihood. A residual is the component of the error of a match along the unit vector m, the
// derivative of the residual by the four image coordinates. m turns with t, most strongly near the epipole. Sums of
// products of errors therefore enter D, and the estimate is the base where they happen to be smallest. To separate
// these effects, correct each match by -r m, so that it satisfies the estimate, and let r0(t) be its residual for
// another base:
//
//     S + K = min_R sum w r0(t)^2 / sigma^2,    K = (sum w k + 4 (2 sum w^2 k^2)^1/2) sigma_x^2 / sigma^2,
//     k = 1 - (m(t) . m(estimate))^2,           sigma_x^2 = sum w (r / (1 + r^2/s^2))^2 / (kappa (sum w - 5)):
//
// S is the evidence that tells t from the estimate; K is the contribution of the errors as m turns. K includes four of
// its standard deviations, because the estimate is the smallest of many values (with two of them, one of 150 pairs with
// the base along the normal was off by more than 3 sigmas). sigma_x is the standard deviation of an image coordinate.
//
// D has the mean S if the estimate is the truth, the mean -S if t is, and the variance 4 (S + K) in both cases. The
// ratio of the two normal densities gives the logarithm of the odds of t against the estimate,
//
//     -1/2 D S / (S + K),
//
// It is zero without a base, where S = 0, and that of least squares where base and parallaxes are far above the errors.
//
// The covariance is the second moment of (R(t), t) about the estimate over these odds, plus the covariance of the
// rotation with the base held fixed. The moment refers to the estimate rather than the mean, because the error of the
// estimate is wanted.
//
// The integral over t runs along eight rays from the estimate, in units in which the logarithm of the odds falls to
// about -1/2. A ray ends where almost nothing is left; a second maximum behind such a barrier is the business of the
// twin. Along a ray the rotation follows the base by linear prediction and one Gauss-Newton step. Each base costs one
// pass over the matches, a covariance about sixty.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "geometry/two_view/point_pairs.h"
#include "geometry/two_view/relative_orientation.h"

namespace megablock {

// Parameters of the cost C, see above.
struct BaseCost {
  double scale = 0;     // s
  double slope = 0;     // kappa
  double variance = 0;  // sigma^2
};

// Returns the covariance (radians) of the rotation increment w (3) and of the base along axes_across (2, sampson.h).
// `linear` is the approximate covariance of the base from the curvature, a first guess. `weights` are the w of the
// pairs. Empty where the matches leave the base undetermined, or where the estimate is not a minimum.
std::optional<Eigen::Matrix<double, 5, 5>> covariance_of_open_base(const RelativeOrientation& estimate,
                                                                   const Eigen::Matrix2d& linear,
                                                                   const PointPairs& points,
                                                                   std::span<const double> weights,
                                                                   const BaseCost& cost);

}  // namespace megablock
