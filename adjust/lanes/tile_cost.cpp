// Sums in a fixed order: image observations by point and row, then the other types in the order of
// observation_types_of_cost(). Costs of two states are compared to tell whether an iteration has improved a tile, so
// that they must not differ by the order of their sums.
#include "adjust/lanes/tile_cost.h"

#include <cmath>
#include <limits>

#include "adjust/lanes/residual_squares.h"
#include "adjust/terms/terms.h"

namespace megablock {

namespace {

double image_cost(const TileProblem& problem, const TileState& state) {
  double sum = 0;
  const SeenImages seen(problem, state);
  ResidualSquares residuals(problem, state, seen);
  residuals.visit(residuals.active_points(), [&](std::int64_t, std::int64_t, double squares) {
    // A state that puts a kept observation behind its camera has an infinite cost, so that no search accepts it.
    sum += std::isfinite(squares) ? problem.image_loss.evaluate(squares)[0] : std::numeric_limits<double>::infinity();
  });
  return sum;
}

}  // namespace

double other_cost(const TileProblem& problem, const TileState& state) {
  double sum = 0;
  const TermVisit add = [&](const LinearTerm& term) { sum += term.loss.evaluate(term.squares)[0]; };
  for (const ObservationType* type : observation_types_of_cost())
    for (std::size_t row = 0; row < type->count(problem); ++row) type->linearise(problem, state, row, add);
  return 0.5 * sum;
}

double evaluate_cost(const TileProblem& problem, const TileState& state) {
  return 0.5 * image_cost(problem, state) + other_cost(problem, state);
}

}  // namespace megablock
