// Computes how well the observations of a block determine the mounts of its rigs. From the normal equations it
// eliminates frames, cameras and points; the free mounts remain.
//
// S is this condensed matrix without the priors of the mounts. The observations do not determine a direction whose
// standard deviation in S is above 0.1 m or 5 degrees. The scale of a rig is the movement of all its free mounts away
// from its reference; tie points alone never determine it. With P the information of the priors, the covariance is (S +
// P)^-1. Where the priors only keep the system regular, it is the covariance at the present scale of the rig.
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
