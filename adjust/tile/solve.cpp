// Solves a tile with Ceres, the reference of the tests. The points are eliminated first (group 0 of the ordering):
// their 3 x 3 blocks are independent of one another, and the Schur complement has the unknowns of frames, cameras and
// mounts alone.
//
// sigma0^2 = sum of weighted squares / (residuals - unknowns + datum defect). The defect counts because the unknowns
// along free directions of the datum are fixed by constraints and not by observations.
#include <ceres/ceres.h>
#include <fmt/core.h>

#include <cmath>

#include "adjust/lanes/residual_squares.h"
#include "adjust/terms/terms.h"
#include "adjust/tile/ceres_problem.h"
#include "adjust/tile/datum.h"
#include "adjust/tile/tile_adjustment.h"
#include "io/base/error.h"

namespace megablock {

namespace {

// The weighted squares and the number of the residuals that take part. Image residuals count in full, because they have
// been screened. Priors under a robust loss count with their robust weight, because a wrong GNSS position must not
// decide sigma0.
struct ResidualSum {
  double squares = 0;
  std::int64_t residuals = 0, observations = 0, points = 0;
};

void add_images(const TileProblem& problem, const TileState& state, ResidualSum& sum) {
  const SeenImages seen(problem, state);
  ResidualSquares residuals(problem, state, seen);
  const std::vector<std::int64_t> active = residuals.active_points();
  sum.points += std::ssize(active);
  residuals.visit(active, [&](std::int64_t, std::int64_t, double squares) {
    sum.squares += squares;
    ++sum.observations;
  });
  sum.residuals += 2 * sum.observations;
}

void add_others(const TileProblem& problem, const TileState& state, ResidualSum& sum) {
  const TermVisit add = [&](const LinearTerm& term) {
    sum.squares += term.loss.evaluate(term.squares)[1] * term.squares;
    sum.residuals += term.number;
  };
  for (const ObservationType* type : observation_types())
    for (std::size_t row = 0; row < type->count(problem); ++row) type->linearise(problem, state, row, add);
}

ceres::Solver::Options solver_options(CeresTile& tile, std::size_t frames, const SolveOptions& options) {
  ceres::Solver::Options result;
  constexpr std::size_t kDenseFrames = 150;  // up to this number a dense solver is faster (measured)
  result.linear_solver_type = frames <= kDenseFrames ? ceres::DENSE_SCHUR : ceres::SPARSE_SCHUR;
  result.dense_linear_algebra_library_type = ceres::LAPACK;
  result.num_threads = 1;
  result.max_num_iterations = options.max_iterations;
  result.function_tolerance = options.function_tolerance;
  // Of the three limits of Ceres only the share of the cost decides. That of the gradient depends on the units of the
  // unknowns.
  result.gradient_tolerance = 0;
  result.parameter_tolerance = 1e-14;
  // A step that puts a kept point behind its camera is invalid for Ceres, which then shortens the step.
  result.max_num_consecutive_invalid_steps = 20;
  result.initial_trust_region_radius = 1e6;  // start values are good, and weak directions need long steps
  result.logging_type = ceres::SILENT;
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  std::vector<double*> all;
  tile.problem().GetParameterBlocks(&all);
  for (double* block : all) ordering->AddElementToGroup(block, tile.is_point(block) ? 0 : 1);
  result.linear_solver_ordering = std::move(ordering);
  return result;
}

}  // namespace

void describe_solution(const TileProblem& problem, const TileState& state, std::int64_t unknowns,
                       std::int64_t datum_defect, AdjustSummary& summary) {
  ResidualSum sum;
  add_images(problem, state, sum);
  add_others(problem, state, sum);
  const std::int64_t freedom = sum.residuals - unknowns + datum_defect;
  summary.observations = sum.observations;
  summary.points = sum.points;
  summary.degrees_of_freedom = freedom;
  summary.sigma0 = freedom > 0 ? std::sqrt(sum.squares / static_cast<double>(freedom)) : 0;
  summary.text = fmt::format("{} images, {} points, {} observations: sigma0 {:.3f}, {} iterations",
                             problem.images.size(), sum.points, sum.observations, summary.sigma0, summary.iterations);
}

AdjustSummary solve_with_ceres(const TileProblem& problem, TileState& state, const SolveOptions& options) {
  AdjustSummary result;
  CeresTile tile(problem, state, {CeresOptions::Derivatives::kAnalytic, options.camera_free});
  // The free directions are those of the start. The constraints hold two frames there, along these directions alone.
  const std::vector<DatumDefect> defects = datum_defects(problem, state);
  constrain_datum(defects, tile);
  if (tile.unknown_blocks().empty()) throw ComputeError("the tile has no observations to adjust");

  ceres::Solver::Summary summary;
  ceres::Solve(solver_options(tile, problem.frames.size(), options), &tile.problem(), &summary);
  result.usable = summary.IsSolutionUsable() && std::isfinite(summary.final_cost);
  result.initial_cost = summary.initial_cost;
  result.final_cost = summary.final_cost;
  result.iterations = static_cast<int>(summary.iterations.size());
  if (result.usable) tile.store(state);

  std::int64_t unknowns = 0, defect = 0;
  for (const double* block : tile.unknown_blocks()) unknowns += tile.problem().ParameterBlockTangentSize(block);
  for (const DatumDefect& d : defects) defect += d.dimension;
  describe_solution(problem, state, unknowns, defect, result);
  if (!result.usable) result.text += ", failed: " + summary.message;
  return result;
}

AdjustSummary solve_with_ceres(const TileProblem& problem, TileState& state, int max_iterations,
                               double function_tolerance) {
  return solve_with_ceres(problem, state, SolveOptions{max_iterations, function_tolerance, {}});
}

}  // namespace megablock
