// A tile's adjustment by the condensation of the merge: the solver that cluster/ gives to adjust_tile.
//
// The tile is a block of its own, of one leaf, and its steps are those of the global adjustment (global_adjustment.h):
// points eliminated one by one, cells of 32 frames as dense fronts, the curvature of the losses, steps that turn the
// whole tile applied as a similarity. It ends when the cost hardly falls, as a tile is only a start for the block.
//
// A tile may start metres off. What brings it home from there: damping that starts high where residuals are many sigmas
// and falls as steps do what they promise; rejection of steps after which a point lies behind a camera; and points in
// the tail of the loss brought to their own optimum after every step (point_refinement.h), which under a loss as wide
// as the residuals are all of them. From a good start weak modes are not damped at all.
#pragma once

#include "adjust/tile/tile_adjustment.h"

namespace megablock {

// As TileSolver; deterministic.
AdjustSummary solve_by_condensation(const TileProblem& problem, TileState& state, const SolveOptions& options);

}  // namespace megablock
