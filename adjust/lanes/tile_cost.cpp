#include "adjust/lanes/tile_cost.h"

#include <cmath>
#include <limits>

#include "adjust/lanes/residual_squares.h"
#include "adjust/terms/line_terms.h"
#include "adjust/terms/linearise.h"
#include "adjust/terms/prior_loss.h"
#include "adjust/terms/vertical_terms.h"

namespace megablock {

namespace {

double image_cost(const TileProblem& problem, const TileState& state) {
  double sum = 0;
  const SeenImages seen(problem, state);
  ResidualSquares residuals(problem, state, seen);
  residuals.visit(residuals.active_points(), [&](std::int64_t, std::int64_t, double squares) {
    sum += std::isfinite(squares) ? problem.image_loss.evaluate(squares)[0] : std::numeric_limits<double>::infinity();
  });
  return sum;
}

}  // namespace

double other_cost(const TileProblem& problem, const TileState& state) {
  double sum = 0;
  for (const auto& term : problem.positions) {
    const double s = linearise_position(state.frames[term.frame.value], term.prior).residual.squaredNorm();
    sum += loss_of(problem, term).evaluate(s)[0];
  }
  for (const auto& term : problem.attitudes)
    sum += loss_of(problem, term)
               .evaluate(linearise_attitude(state.frames[term.frame.value], term.prior).residual.squaredNorm())[0];
  for (const auto& term : problem.relatives) {
    const auto r = linearise_relative(state.frames[term.from.value], state.frames[term.to.value], term).residual;
    sum += problem.relative_loss.evaluate(r.squaredNorm())[0];
  }
  for (const auto& term : problem.lines) {
    const double r = linearise_line(state.frames[term.frame.value], state.frames[term.seen_by().value], term).residual;
    sum += problem.line_loss.evaluate(r * r)[0];
  }
  for (const auto& term : problem.verticals)
    sum += problem.vertical_loss.evaluate(linearise_vertical(problem, state, term).residual.squaredNorm())[0];
  for (const auto& term : problem.point_priors)
    if (problem.active(term.point.value))
      sum += point_prior_residual(state.points[term.point.value], term).squaredNorm();
  for (const auto& term : problem.intrinsic_priors) {
    for (int k = 0; k < term.value.size(); ++k) {
      const double r = intrinsic_prior_residual(state.cameras[term.camera.value], term, k);
      sum += r * r;
    }
  }
  for (const auto& term : problem.mount_priors)
    sum += linearise_mount(state.mounts[term.mount], term).residual.squaredNorm();
  return 0.5 * sum;
}

double evaluate_cost(const TileProblem& problem, const TileState& state) {
  return 0.5 * image_cost(problem, state) + other_cost(problem, state);
}

}  // namespace megablock
