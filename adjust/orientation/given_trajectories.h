// Given poses adjusted to what is observed of the frames alone, before any tie point is looked at.
//
// Poses that odometry or an inertial system has integrated are right from frame to frame and, after kilometres, tens of
// metres and some degrees off. Points that two such passes see cannot be told from wrong ones then. With the observed
// positions and attitudes, however few, relative poses give a trajectory to a fraction of a metre.
//
// A trajectory is a chain of frames of which relative poses tie each to the next; of a frame with more than two of them
// those to the nearest frames in the block's order count. Its poses minimise the squares of the position, attitude and
// relative pose residuals (tile_problem.h), Gauss-Newton first and then with a loss that forgets gross errors. The
// normal matrix is block tridiagonal, D_k and C_k = J_k' J_k+1 of six rows and columns; its elimination
//
//     S_1 = D_1,   S_k+1 = D_k+1 - C_k' S_k^-1 C_k,    then back from the last frame to the first,
//
// is kept for one piece of the chain at a time, and done again from the piece's beginning on the way back, so that a
// trajectory of any length takes a pose per frame. This is the smoother of H. Rauch, F. Tung and C. Striebel, AIAA
// Journal 3, 1965, in its information form.
#pragma once

#include <cstdint>

#include "adjust/problem/tile_problem.h"
#include "io/block/block.h"

namespace megablock {

struct GivenTrajectoryOptions {
  // A trajectory stays as it is given unless its positions, attitudes or relative poses contradict it: the mean of the
  // squared residuals per component, in sigmas and with gross errors held down, is larger.
  double max_mean_square = 2;
};

struct GivenTrajectoryChange {
  std::int64_t trajectories = 0, frames = 0;  // that were adjusted
  double rms_m = 0, largest_m = 0;            // how far their frames were moved
};

// Adjusts the trajectories of oriented frames of `state` that contradict what is observed of them, each to where it
// contradicts less; one without any observed position or attitude stays. `use`: which observations count.
GivenTrajectoryChange adjust_trajectories(const Block& block, const ObservationOptions& use, BlockState& state,
                                          const GivenTrajectoryOptions& options = {});

}  // namespace megablock
