// Adjusts the problem of a tile with Ceres, as the reference for our own optimum.
#pragma once

#include <ceres/ceres.h>

#include <limits>

#include "adjust/tile/ceres_problem.h"

namespace megablock {

// Cost after so many steps from a state, until no tolerance of double precision is left; NaN where Ceres fails.
inline double cost_after_ceres(const TileProblem& problem, const TileState& state, int max_iterations) {
  CeresTile tile(problem, state);
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_SCHUR;
  options.function_tolerance = options.gradient_tolerance = options.parameter_tolerance = 1e-16;
  options.max_num_iterations = max_iterations;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &tile.problem(), &summary);
  return summary.IsSolutionUsable() ? summary.final_cost : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace megablock
