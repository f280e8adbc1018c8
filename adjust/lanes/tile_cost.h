// Gives the cost of a tile at a state: half the sum of the robust losses of all its residuals.
//
// Robust weighting as Ceres (corrector): residual and Jacobian are scaled by sqrt(rho'); the second-order term is
// applied where rho'' > 0 and dropped where rho'' <= 0 (always, for the losses here).
#pragma once

#include "adjust/problem/tile_problem.h"

namespace megablock {

// Total cost F = 1/2 sum rho(|r|^2) over everything in the problem; infinity when a kept observation is behind a
// camera (cannot be projected).
double evaluate_cost(const TileProblem& problem, const TileState& state);
// The cost of everything but the image observations.
double other_cost(const TileProblem& problem, const TileState& state);

}  // namespace megablock
