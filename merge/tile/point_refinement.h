// Moves points whose observations lie in the tail of the loss to their own optimum at held poses.
//
// A point with few observations, most of them in the tail, has hardly any curvature along some direction. Neither the
// reweighted nor the true normal equations of the block then bring it to its optimum in few iterations, and a handful
// of such points delays all others. For a single point the problem is small: damped Newton iterations in three
// unknowns, with the curvature of the loss (tile_linearisation.h, bounded by zero only). It is solved for the trial
// state of every iteration. So it only lowers the cost by which the step is judged, and the optimum stays the same
// (inner iterations).
#pragma once

#include <span>

#include "adjust/lanes/observation_lanes.h"
#include "merge/tile/condense.h"
#include "merge/tile/tile_linearisation.h"

namespace megablock {

// What points cost, and which of them have an observation beyond the corner (Cauchy's loss has none: all of it is tail)
// or behind its camera.
class LossSums {
 public:
  explicit LossSums(const RobustLoss& loss) : loss_(loss), usual_squares_(end_of_squares(loss)) {}
  void add(std::int64_t point, std::span<const double> squares);  // |r|^2 of its observations
  double settled() const { return settled_; }                     // twice the cost of all others
  const std::vector<std::int64_t>& tail() const { return tail_; }

 private:
  RobustLoss loss_;
  double usual_squares_;
  double settled_ = 0;
  std::vector<std::int64_t> tail_;
};

// Moves active points that have an observation in the tail and are off their optimum by more than `settled` sigmas; all
// others keep their bits. A point that a step has put behind a camera starts from the intersection of its rays; where
// they do not meet in front of all cameras, it is left alone. Returns the cost then: that of
// evaluate_cost (linearise.h) but for the order of the sum.
constexpr double kPointSettled = 1e-6;
double refine_points(const TileProblem& problem, const TilePlan& plan, TileState& state,
                     double settled = kPointSettled);
// The same where the squares are known: `images` of the state, `sums` of portions of its points, in their order.
double refine_tail(const TileProblem& problem, TileState& state, const SeenImages& images,
                   const std::vector<LossSums>& sums, double settled);

}  // namespace megablock
