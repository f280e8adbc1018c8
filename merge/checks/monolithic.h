// Adjusts the whole block as one system, from one Ceres problem with automatic derivatives, as the reference for the
// merge. It uses none of the linearisation and elimination code of this room, so that the agreement of the two is
// evidence.
//
// At a state with the residuals r and the Jacobian J of all observations, the undamped Newton step of the whole block
// is x = -(J'J)^-1 J'r. At the optimum of the merge it must be zero. Its components are therefore compared with their
// posterior sigmas, the roots of the diagonal of (J'J)^-1: they say how far the merge has stopped from the optimum.
//
// The block must fit in memory. Steps are solved with sparse matrices. Covariances are dense: their dimension is six
// times the number of frames (2 GiB for 2 500 frames).
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <optional>

#include "adjust/problem/tile_problem.h"
#include "merge/datum/gauge.h"

namespace megablock {

// The weighted Jacobian and the residual of the whole block. The columns are those of frames, cameras and mounts, in
// the order of the tables of the problem, and then those of the points. Only unknowns that are free and observed have
// columns.
struct MonolithicSystem {
  Eigen::SparseMatrix<double> jacobian;
  Eigen::VectorXd residual;
  double cost = 0;
  std::vector<std::int64_t> frame_column, camera_column, mount_column, point_column;  // first column, -1: none
  std::int64_t reduced_dimension = 0;                                                 // columns before the points

  Eigen::VectorXd gradient() const { return jacobian.transpose() * residual; }
  Eigen::VectorXd diagonal() const;  // of J'J
};

// `problem` is one tile that holds the whole block.
MonolithicSystem monolithic_system(const TileProblem& problem, const TileState& state);

// The datum of a free block: rows [k x columns] whose squares are added to J'J. It is empty where priors fix the datum.
using DatumRows = Eigen::SparseMatrix<double>;

// Solves (J'J + lambda diag(J'J)) x = -J'r by CHOLMOD. Throws ComputeError when the matrix is not positive definite.
Eigen::VectorXd monolithic_step(const MonolithicSystem& system, double lambda);

// The inverse of the undamped normal equations after elimination of the points, dense: the covariance of all other
// unknowns. Throws ComputeError when the datum is free.
Eigen::MatrixXd monolithic_covariance(const MonolithicSystem& system, const DatumRows& datum = {});

// Standard deviations of the frames (rotation, radians; position, metres), one column for each row of the table of
// frames.
using FrameSigmas = Eigen::Matrix<double, 6, Eigen::Dynamic>;

// The largest ratio of a component of the undamped Newton step at `state` and its posterior sigma, over all frames.
double max_pose_difference_sigmas(const TileProblem& problem, const TileState& state);
// The same for a block whose datum may be free. The constraints of `gauge` hold the datum; step and covariance are then
// moved to inner constraints. `plan` is the plan of the problem as the only tile. `sigmas` replace the posterior sigmas
// where a dense covariance would be too large.
double max_pose_difference_sigmas(const TileProblem& problem, const TileState& state, const BlockGauge& gauge,
                                  const TilePlan& plan, const std::optional<FrameSigmas>& sigmas = {});

}  // namespace megablock
