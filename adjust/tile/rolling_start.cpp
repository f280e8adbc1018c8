#include "adjust/tile/rolling_start.h"

namespace megablock {

void correct_rolling_start(const RollingShutters& shutters, const AdjustOptions& options, TileProblem& problem,
                           TileState& at) {
  const std::vector<std::uint8_t> kept = problem.kept;
  const std::vector<double> x = problem.x, y = problem.y;
  const std::vector<Motion> motions = tile_motions(shutters.paths, problem, at, shutters.others);
  std::vector<std::uint8_t> unknown;
  for (const Eigen::Vector3d& point : at.points) unknown.push_back(!point.allFinite());
  for (int round = 0; round < 2; ++round) {
    triangulate_points(problem, at, options, unknown);
    problem.kept = kept;
    problem.x = x;
    problem.y = y;
    correct_rolling_shutter(shutters.readouts, motions, at, problem);
  }
}

AdjustSummary adjust_moving_tile(const RollingShutters& shutters, TileProblem& problem, TileState& state,
                                 const AdjustOptions& options, const TileSolver& solver) {
  const std::vector<std::uint8_t> kept = problem.kept;
  const std::vector<double> x = problem.x, y = problem.y;
  AdjustSummary summary;
  for (int round = 0; round < 2; ++round) {
    problem.kept = kept;
    problem.x = x;
    problem.y = y;
    TileState at = state;
    correct_rolling_start(shutters, options, problem, at);
    summary = adjust_tile(problem, state, options, solver);
  }
  return summary;
}

}  // namespace megablock
