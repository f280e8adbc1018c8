// Adjusts given poses to the observed positions, attitudes and relative poses of the frames, before any tie point is
// used.
//
// Odometry and inertial systems integrate their poses. Such poses are accurate from frame to frame, but after
// kilometres they are off by tens of metres and some degrees. Tie points between two such passes then cannot be told
// from outliers. A few observed positions and attitudes, together with the relative poses, give a trajectory to a
// fraction of a metre.
//
// A trajectory is a chain of frames in which relative poses tie each frame to the next. If a frame has more than two
// relative poses, the two to the nearest frames in the block's order count. The adjustment minimises the squares of the
// position, attitude and relative pose residuals (tile_problem.h), first by Gauss-Newton iterations without a loss and
// then with a loss that damps outliers. The normal matrix is block tridiagonal, with blocks D_k and C_k = J_k' J_k+1 of
// six rows and columns. Its elimination
//
//     S_1 = D_1,   S_k+1 = D_k+1 - C_k' S_k^-1 C_k,    then back from the last frame to the first,
//
// is stored for one piece of the chain at a time and repeated from the beginning of each piece on the way back. So the
// memory is mainly that of the poses. This is the smoother of H. Rauch, F. Tung and C. Striebel, AIAA
// Journal 3, 1965, in its information form.
#pragma once

#include <cstdint>

#include "adjust/problem/tile_problem.h"
#include "io/block/block.h"

namespace megablock {

struct GivenTrajectoryOptions {
  // Limit of the mean squared residual per component, in sigmas and with outliers damped. A trajectory is adjusted only
  // if its positions, attitudes or relative poses exceed it.
  double max_mean_square = 2;
};

struct GivenTrajectoryChange {
  std::int64_t trajectories = 0, frames = 0;  // adjusted ones
  double rms_m = 0, largest_m = 0;            // movement of their frames
};

// Adjusts the trajectories of the oriented frames of `state` that contradict their observations. A trajectory keeps its
// poses if the adjustment does not reduce the contradiction, or if it has no observed position or attitude. `use` says
// which observations take part.
GivenTrajectoryChange adjust_trajectories(const Block& block, const ObservationOptions& use, BlockState& state,
                                          const GivenTrajectoryOptions& options = {});

}  // namespace megablock
