// Gives the robust losses of observed positions, control points and attitudes. Held ones have none, because a loss
// would release them.
#pragma once

#include "adjust/problem/tile_problem.h"
#include "io/block/held_priors.h"

namespace megablock {

inline bool held(const TileProblem::PointTerm& term) { return term.sigma.minCoeff() <= 2 * kHeldPositionSigma; }

inline RobustLoss loss_of(const TileProblem& problem, const TileProblem::PositionTerm& term) {
  return held(term.prior) ? RobustLoss() : problem.position_loss;
}
inline RobustLoss loss_of(const TileProblem& problem, const TileProblem::PointTerm& term) {
  return held(term) ? RobustLoss() : problem.control_loss;
}
inline RobustLoss loss_of(const TileProblem& problem, const TileProblem::AttitudeTerm& term) {
  return held(term.prior) ? RobustLoss() : problem.attitude_loss;
}

}  // namespace megablock
