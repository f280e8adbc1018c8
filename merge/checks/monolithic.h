// The reference for the merge: the whole block as one system, from one Ceres problem with automatic derivatives. It
// uses none of the linearisation and elimination code of this room, so that agreement of the two is evidence.
//
// Only for blocks that fit in memory. Steps are solved with sparse matrices. Covariances are dense, with six times the
// number of frames as their dimension (2 GiB for 2 500 frames).
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <optional>

#include "adjust/problem/tile_problem.h"
#include "merge/datum/gauge.h"

namespace megablock {

// Weighted Jacobian and residual of the whole block. Columns: frames, cameras, mounts (rows of the problem's tables,
// only those that are unknown and observed), then points.
struct MonolithicSystem {
  Eigen::SparseMatrix<double> jacobian;
  Eigen::VectorXd residual;
  double cost = 0;
  std::vector<std::int64_t> frame_column, camera_column, mount_column, point_column;  // first column, -1: none
  std::int64_t reduced_dimension = 0;                                                 // columns before the points

  Eigen::VectorXd gradient() const { return jacobian.transpose() * residual; }
  Eigen::VectorXd diagonal() const;  // of J'J
};

// `problem`: one tile that holds the whole block.
MonolithicSystem monolithic_system(const TileProblem& problem, const TileState& state);

// The datum of a free block: rows [k x columns] that hold it, added to J'J as squares; empty where priors fix the
// datum.
using DatumRows = Eigen::SparseMatrix<double>;

// x of (J'J + lambda diag(J'J)) x = -J'r by CHOLMOD. Throws ComputeError when it is not positive definite.
Eigen::VectorXd monolithic_step(const MonolithicSystem& system, double lambda);

// Inverse of the reduced (points eliminated) undamped normal equations: covariances of everything but points, dense.
// Throws ComputeError when the datum is free.
Eigen::MatrixXd monolithic_covariance(const MonolithicSystem& system, const DatumRows& datum = {});

// Standard deviations of the frames (rotation, radians; position, metres), one column for each row of the table of
// frames.
using FrameSigmas = Eigen::Matrix<double, 6, Eigen::Dynamic>;

// Largest component of the undamped Newton step at `state` over its posterior sigma, over all frames.
double max_pose_difference_sigmas(const TileProblem& problem, const TileState& state);
// The same for a block whose datum may be free: held by the constraints of `gauge`, step and covariance then moved to
// inner constraints. `plan`: of the problem as the only tile. `sigmas`: those to divide by, where a dense covariance
// would be too large.
double max_pose_difference_sigmas(const TileProblem& problem, const TileState& state, const BlockGauge& gauge,
                                  const TilePlan& plan, const std::optional<FrameSigmas>& sigmas = {});

}  // namespace megablock
