// The information of the observations of a block on the mounts of its rigs: the normal equations condensed on the free
// mounts, with frames, cameras and points eliminated.
//
// S is the condensed matrix without the priors of the mounts. Directions with a standard deviation above 0.1 m or 5
// degrees in S are not determined by the observations. The movement of all free mounts of a rig away from its reference
// is the scale of the rig, which tie points alone never determine. With P the information of the priors, the covariance
// is (S + P)^-1. For mounts whose priors only keep the system regular it is the covariance at the present scale.
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

// `problem` holds the whole block at its solution; every free mount has a prior. `without_scale`: covariances at the
// present scale of the rig where the observations do not determine it.
RigPosterior rig_posterior(const TileProblem& problem, const TileState& state, bool without_scale);

}  // namespace megablock
