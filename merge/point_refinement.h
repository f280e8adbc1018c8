// Points whose observations lie beyond the corner of the loss, brought to their own optimum at held poses.
//
// A point with few observations, most of them in the tail, has hardly any curvature along some direction: neither the
// reweighted nor the true normal equations of the block bring it there in few steps, and a handful of such points holds
// up all others. For a single point the problem is small: a damped Newton iteration in three unknowns, with the loss's
// own curvature (tile_linearisation.h, no lower bound but zero). Done for the trial state of every step, so that it
// only lowers the cost that the step is judged by (inner iterations; the optimum is the same).
#pragma once

#include "merge/condense.h"

namespace megablock {

// Moves active points that have an observation in the tail and are off their optimum by more than `settled` sigmas; all
// others keep their bits. A point that a step has put behind a camera starts from the intersection of its rays; where
// they do not meet in front of all cameras, it is left alone. Returns the cost then: that of
// evaluate_cost (linearise.h) but for the order of the sum.
double refine_points(const TileProblem& problem, const TilePlan& plan, TileState& state, double settled = 1e-6);

}  // namespace megablock
