// Robust losses of positions and attitudes: none for those that are held, which a loss would let go.
#pragma once

#include "adjust/problem/tile_problem.h"
#include "io/block/held_priors.h"

namespace megablock {

inline RobustLoss loss_of(const TileProblem& problem, const TileProblem::PositionTerm& term) {
  return held(term.prior) ? RobustLoss() : problem.position_loss;
}
inline RobustLoss loss_of(const TileProblem& problem, const TileProblem::AttitudeTerm& term) {
  return held(term.prior) ? RobustLoss() : problem.attitude_loss;
}

}  // namespace megablock
