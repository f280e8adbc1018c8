// Condenses the observations of a block on its cameras: a quadratic form of the camera parameters, in which poses,
// mounts and points are at their optimum for any value of the parameters.
//
// At a state near the optimum the weighted squares of the residuals are, with the parameters k of all cameras,
//
//     c(k) = c_0 + (k - k_0)' S (k - k_0)
//
// where S is the Schur complement of the normal matrix on the cameras, and the weights are those of the robust loss at
// the state. The forms of a block with and without some images tell how the estimate depends on them, and how well the
// others predict them (merge/camera/parameter_choice.h).
#pragma once

#include <Eigen/Core>
#include <vector>

#include "adjust/problem/tile_problem.h"

namespace megablock {

// Rows are the free parameters (TileProblem::camera_free) of the cameras, ascending by camera, then by parameter.
struct CameraForm {
  Eigen::VectorXd minimum;      // k_0, in the units of the camera models
  Eigen::MatrixXd information;  // S, with the priors of the cameras
  double least = 0;             // c_0
  double at(const Eigen::VectorXd& parameters) const;
};

// The form of the kept observations. Empty when a free camera has none.
std::optional<CameraForm> condense_on_cameras(const TileProblem& problem, const TileState& state);

// The minimum of the form with the parameters outside of `free` held at the values of `held`. [rows]
Eigen::VectorXd restricted_minimum(const CameraForm& form, const std::vector<std::uint8_t>& free,
                                   const Eigen::VectorXd& held);
// The covariance of the free ones among all rows; zero for held ones.
Eigen::MatrixXd restricted_covariance(const CameraForm& form, const std::vector<std::uint8_t>& free);

}  // namespace megablock
