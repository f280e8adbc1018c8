// Gives the cost of a tile at a state: half the sum of the robust losses of all its residuals.
//
// Robust weights are those of Ceres (corrector): residual and Jacobian are scaled by sqrt(rho'). The second-order term
// is applied where rho'' > 0 and dropped where rho'' <= 0, which is always the case for the losses here.
#pragma once

#include "adjust/problem/tile_problem.h"

namespace megablock {

// The total cost F = 1/2 sum rho(|r|^2) of everything in the problem. It is infinite when a kept observation is behind
// a camera (cannot be projected).
double evaluate_cost(const TileProblem& problem, const TileState& state);
// The cost of all observations except the image observations.
double other_cost(const TileProblem& problem, const TileState& state);

}  // namespace megablock
