// Solves the adjustment of a single tile with the condensation of the merge. cluster/ gives this solver to adjust_tile,
// because adjust/ must not include merge/.
//
// The tile is treated as a block with a tree of one leaf, and its iterations are those of the global adjustment
// (global_adjustment.h): points are eliminated one by one, cells of 32 frames are dense fronts, the curvature of the
// losses is taken, and the part of a step that turns the whole tile is applied as a similarity. The iterations end when
// the cost hardly falls, because a tile is only a start for the block.
//
// A tile may start metres away from its optimum. Three measures make it converge from there. Damping starts high where
// residuals are many sigmas, and falls while steps decrease the cost as predicted. A step that moves a point behind a
// camera is rejected. Points in the tail of the loss are moved to their own optimum after every step
// (point_refinement.h). From a good start weak modes are not damped at all.
#pragma once

#include "adjust/tile/tile_adjustment.h"

namespace megablock {

// A TileSolver of adjust_tile. Deterministic.
AdjustSummary solve_by_condensation(const TileProblem& problem, TileState& state, const SolveOptions& options);

}  // namespace megablock
