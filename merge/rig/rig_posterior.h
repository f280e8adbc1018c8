// Computes how well the observations of a block determine the mounts of its rigs. From the normal equations it
// eliminates frames, cameras and points; the free mounts remain.
//
// S is this condensed matrix without the priors of the mounts, P the information of these priors. Each scalar unknown
// is measured in units of 0.1 m or 5 degrees; with U the diagonal matrix of the units, an eigenvector of U S U with the
// eigenvalue e is a direction whose standard deviation is 1 / sqrt(e) units. The observations do not determine the
// directions with e < 1. The scale of a rig is the movement of all its free mounts away from its reference; tie points
// alone never determine it. The covariance is (S + P)^-1. Where the priors only keep the system regular, it is the
// covariance at the present scale of the rig.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "adjust/problem/tile_problem.h"

namespace megablock {

struct RigPosterior {
  struct MountPosterior {
    std::int32_t mount = -1;                                                       // row of TileProblem::mounts
    Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();  // of PoseIncrement
    bool rotation_determined = true, position_determined = true;
  };
  std::vector<MountPosterior> mounts;  // the free ones, ascending
  bool scale_determined = true;        // of every rig
};

// `problem` holds the whole block at its solution, and every free mount has a prior. With `without_scale` the
// covariances are those at the present scale of a rig whose scale the observations do not determine.
RigPosterior rig_posterior(const TileProblem& problem, const TileState& state, bool without_scale);

}  // namespace megablock
