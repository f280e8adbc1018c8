// Analytic linearisation of single residuals: what merge/ condenses and what the tests hold against automatic
// differentiation. All residuals and Jacobians are already divided by sigma; robust weighting is the caller's.
#pragma once

#include "adjust/tile_problem.h"

namespace megablock {

struct ImageResidual {
  Eigen::Vector2d residual;
  Eigen::Matrix<double, 2, 6> by_frame;
  Eigen::Matrix<double, 2, 6> by_mount;
  IntrinsicJacobian by_intrinsics;
  Eigen::Matrix<double, 2, 3> by_point;
  // The camera can project the point; otherwise the rest is undefined and the observation must not take part.
  bool in_front = false;
};
ImageResidual linearise_image(const Pose& frame, const Pose& mount, const Intrinsics& intrinsics,
                              const Eigen::Vector3d& point, const Eigen::Vector2d& measured, double inverse_sigma);

// Adjusted minus measured position of one observation (a row of the problem) of a point, pixels; NaN where the camera
// cannot project the point.
Eigen::Vector2d image_difference_px(const TileProblem& problem, const TileState& state, std::int64_t point,
                                    std::int64_t row);

struct FrameResidual3 {
  Eigen::Vector3d residual;
  Eigen::Matrix<double, 3, 6> by_frame;
};
FrameResidual3 linearise_position(const Pose& frame, const PositionPrior& prior);
FrameResidual3 linearise_attitude(const Pose& frame, const AttitudePrior& prior);

struct RelativeResidual {
  Eigen::Matrix<double, 6, 1> residual;
  Eigen::Matrix<double, 6, 6> by_from, by_to;
};
RelativeResidual linearise_relative(const Pose& from, const Pose& to, const TileProblem::RelativeTerm& term);

struct MountResidual {
  Eigen::Matrix<double, 6, 1> residual;
  Eigen::Matrix<double, 6, 6> by_mount;
};
MountResidual linearise_mount(const Pose& mount, const TileProblem::MountTerm& term);

// Priors that are linear in their unknowns; their derivative is the inverse sigma. Axes with infinite sigma and
// parameters without a finite positive sigma give zero.
inline Eigen::Vector3d point_prior_residual(const Eigen::Vector3d& point, const TileProblem::PointTerm& term) {
  return (point - term.position).cwiseQuotient(term.sigma);
}
inline double intrinsic_prior_residual(const Intrinsics& value, const TileProblem::IntrinsicTerm& term, int parameter) {
  const auto k = static_cast<std::size_t>(parameter);
  return intrinsic_prior_weight(term, parameter) * (value[k] - term.value[k]);
}

// Robust weighting as Ceres (corrector): residual and Jacobian are scaled by sqrt(rho'); the second-order term is
// applied where rho'' > 0 and dropped where rho'' <= 0 (always, for the losses here).
// Total cost F = 1/2 sum rho(|r|^2) over everything in the problem; infinity when a kept observation is behind a
// camera (cannot be projected).
double evaluate_cost(const TileProblem& problem, const TileState& state);

}  // namespace megablock
