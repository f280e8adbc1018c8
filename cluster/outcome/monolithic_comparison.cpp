#include "cluster/outcome/monolithic_comparison.h"

#include <ceres/solver.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <random>

#include "adjust/terms/linearise.h"
#include "adjust/tile/ceres_problem.h"
#include "cluster/job/job_options.h"
#include "cluster/outcome/result_tile.h"
#include "io/base/error.h"
#include "io/result/result.h"
#include "merge/checks/monolithic.h"
#include "merge/tree/merge_in_memory.h"

namespace megablock {

namespace {

using Json = nlohmann::json;

double cost_after_ceres(const ResultTile& tile) {
  CeresTile ceres_tile(tile.problem, tile.state);
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_SCHUR;
  options.function_tolerance = options.gradient_tolerance = options.parameter_tolerance = 1e-16;
  options.max_num_iterations = 20;
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &ceres_tile.problem(), &summary);
  if (!summary.IsSolutionUsable()) throw ComputeError("Ceres fails: " + summary.message);
  return summary.final_cost;
}

// The a-priori sigma, even if the job reports scaled ones.
double sigma_of(const BlockResult& result, FrameIndex frame, int k) {
  const double factor = result.sigma_scaled ? result.variance_factor : 1;
  return std::sqrt(result.frame_covariance[frame](k, k) / factor);
}

// The sigmas of the job, where a dense covariance of the monolithic problem would take more than 2 GiB.
std::optional<FrameSigmas> sigmas_to_compare_by(const BlockResult& result, const TileProblem& problem) {
  constexpr std::size_t kDenseFrames = 2500;
  if (problem.frames.size() <= kDenseFrames) return std::nullopt;
  FrameSigmas sigmas(6, std::ssize(problem.frames));
  for (Eigen::Index f = 0; f < sigmas.cols(); ++f)
    for (int k = 0; k < 6; ++k) sigmas(k, f) = sigma_of(result, problem.frames[static_cast<std::size_t>(f)], k);
  return sigmas;
}

// Moves every component by a normal deviate of a tenth of its sigma.
TileState disturbed(const BlockResult& result, const ResultTile& tile) {
  constexpr double kShare = 0.1;
  std::mt19937_64 random(1);
  std::normal_distribution<double> gauss(0, kShare);
  TileState state = tile.state;
  for (std::size_t f = 0; f < state.frames.size(); ++f) {
    PoseIncrement d;
    for (int k = 0; k < 6; ++k) d[k] = gauss(random) * sigma_of(result, tile.problem.frames[f], k);
    state.frames[f] = pose_update(state.frames[f], d);
  }
  return state;
}

struct OwnRun {
  double pose_difference_sigmas = 0;
  GlobalState end;
};

OwnRun adjust_single_tile(const BlockResult& result, const ResultTile& tile) {
  MergeInMemory runner(single_tile(result.block).tree, {tile.problem}, {disturbed(result, tile)});
  GlobalOptions options;
  options.max_decrement = 1e-6;
  OwnRun run;
  run.end = start_global(options);
  adjust_globally(runner, options, run.end);
  for (std::size_t f = 0; f < tile.state.frames.size(); ++f) {
    const Pose &job = tile.state.frames[f], &own = runner.states().front().frames[f];
    PoseIncrement d;
    d << rotation_log<double>(job.rotation.conjugate() * own.rotation), own.centre - job.centre;
    for (int k = 0; k < 6; ++k)
      run.pose_difference_sigmas =
          std::max(run.pose_difference_sigmas, std::abs(d[k]) / sigma_of(result, tile.problem.frames[f], k));
  }
  return run;
}

}  // namespace

ObservationOptions observation_options(const JobStore& store) { return options_of_job(store).adjustment.observations; }

std::string compare_with_monolithic(const JobStore& store) {
  if (!store.seal(kResult)) throw InputError(store.path(kResult) + ": the job has no result yet; run it to the end");
  const BlockResult result = read_result(store.verified_path(kResult));
  const ResultTile tile = tile_of_result(result, observation_options(store));
  MergeInMemory runner(single_tile(result.block).tree, {tile.problem}, {tile.state});
  const SubtreeSums sums = runner.up(0).sums;
  Json json{{"images", tile.problem.images.size()},
            {"tiles", result.tiles.tile_count},
            {"points", sums.points},
            {"observations", sums.observations},
            {"newton_decrement", std::sqrt(sums.decrement_squared)},
            {"free_datum", runner.block_gauge().defect()}};
  json["max_pose_difference_sigmas"] =
      max_pose_difference_sigmas(tile.problem, tile.state, runner.block_gauge(), runner.tile_plans().front(),
                                 sigmas_to_compare_by(result, tile.problem));
  json["relative_cost_difference"] = (sums.cost - cost_after_ceres(tile)) / sums.cost;
  if (runner.block_gauge().free()) return json.dump();
  const OwnRun own = adjust_single_tile(result, tile);
  json["single_tile_pose_difference_sigmas"] = own.pose_difference_sigmas;
  json["single_tile_steps"] = own.end.iterations;
  json["single_tile_converged"] = own.end.outcome == GlobalOutcome::kConverged;
  return json.dump();
}

}  // namespace megablock
