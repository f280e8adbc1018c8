// What the measurements of a block say of the mounts of its rigs: the normal equations condensed on the free mounts,
// frames, cameras and points eliminated.
//
// With S the condensed matrix without the mounts' priors, directions that S knows to no better than 0.1 m or 5 degrees
// are not determined by the measurements. The movement of all free mounts of a rig away from its reference is its
// scale, which tie points alone never give. With P the information of the priors the covariance is (S + P)^-1; or, for
// mounts that are tied to their start only so that the system is regular, that at the scale which the rig has.
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
// scale that the rig has, where the measurements do not determine it.
RigPosterior rig_posterior(const TileProblem& problem, const TileState& state, bool without_scale);

}  // namespace megablock
