// Moves points whose observations lie in the tail of the loss to their own optimum at held poses.
//
// A point with few observations, most of them in the tail, has hardly any curvature along some direction. Neither the
// reweighted nor the true normal equations of the block then bring it to its optimum in few iterations, and a handful
// of such points delays all others. For a single point the problem is small: damped Newton iterations in three
// unknowns, with the curvature of the loss (tile_linearisation.h), which is only kept from becoming negative. It is
// solved for the trial state of every iteration. This only lowers the cost by which the step is judged, and the optimum
// stays the same (inner iterations).
#pragma once

#include <span>

#include "adjust/lanes/observation_lanes.h"
#include "merge/tile/condense.h"
#include "merge/tile/tile_linearisation.h"

namespace megablock {

// Sums the costs of points, and lists those that have an observation in the tail of the loss or behind its camera. The
// tail begins at the corner of the loss; Cauchy's loss has no corner, and all of it is tail.
class LossSums {
 public:
  explicit LossSums(const RobustLoss& loss) : loss_(loss), usual_squares_(end_of_squares(loss)) {}
  void add(std::int64_t point, std::span<const double> squares);  // squares: |r|^2 of its observations
  double settled() const { return settled_; }                     // twice the cost of the points that are not in tail()
  const std::vector<std::int64_t>& tail() const { return tail_; }

 private:
  RobustLoss loss_;
  double usual_squares_;
  double settled_ = 0;
  std::vector<std::int64_t> tail_;
};

// Moves the active points that have an observation in the tail and are farther than `settled` sigmas from their
// optimum. All other points keep their bits. A point that a step has put behind a camera starts from the intersection
// of its rays; where the rays do not meet in front of all cameras, the point stays where it is. Returns the cost
// afterwards; it differs from that of evaluate_cost (linearise.h) only by the order of the sum.
constexpr double kPointSettled = 1e-6;
double refine_points(const TileProblem& problem, const TilePlan& plan, TileState& state,
                     double settled = kPointSettled);
// The same when the squares are known. `images` belong to the state, and `sums` to the portions of its points, in their
// order.
double refine_tail(const TileProblem& problem, TileState& state, const SeenImages& images,
                   const std::vector<LossSums>& sums, double settled);

}  // namespace megablock
