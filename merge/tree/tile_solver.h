// Solves the adjustment of a single tile with the condensation of the merge. cluster/ gives this solver to adjust_tile,
// because adjust/ must not include merge/.
//
// The tile is a block of its own, of one leaf, and its steps are those of the global adjustment (global_adjustment.h):
// points eliminated one by one, cells of 32 frames as dense fronts, the curvature of the losses, steps that turn the
// whole tile applied as a similarity. It ends when the cost hardly falls, as a tile is only a start for the block.
//
// A tile may start metres away from its optimum. Three measures make it converge from there. Damping starts high where
// residuals are many sigmas, and falls while steps decrease the cost as predicted. A step that moves a point behind a
// camera is rejected. Points in the tail of the loss are moved to their own optimum after every step
// (point_refinement.h). From a good start weak modes are not damped at all.
#pragma once

#include "adjust/tile/tile_adjustment.h"

namespace megablock {

// As TileSolver; deterministic.
AdjustSummary solve_by_condensation(const TileProblem& problem, TileState& state, const SolveOptions& options);

}  // namespace megablock
