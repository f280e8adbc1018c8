// Measures the time of the tile adjustment on simulated aerial tiles with one thread: triangulation, screening and
// self-calibration, from given poses that are off by 1 m and 1 degree, with 3 % wrong matches.
//
//     bench_adjust --benchmark_min_time=0.001
#include <benchmark/benchmark.h>

#include <limits>

#include "adjust/terms/build_problem.h"
#include "adjust/tile/tile_adjustment.h"
#include "io/simulate/blocks/simulate.h"

extern "C" void openblas_set_num_threads(int threads);

namespace megablock {
namespace {

void adjust_aerial_tile(benchmark::State& state) {
  openblas_set_num_threads(1);
  SimulationOptions options;
  options.frames = state.range(0);
  options.points_per_frame = static_cast<int>(state.range(1));
  options.outlier_share = 0.03;
  const SimulatedBlock simulated = simulate_block(options);
  const BlockState start = initial_state(simulated.block);
  const AdjustOptions adjust;
  TileProblem problem = make_tile_problem(simulated.block, start, single_tile(simulated.block), TileIndex(0),
                                          simulated.tracks, adjust.observations);
  const Eigen::Vector3d unknown = Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  AdjustSummary summary;
  for (auto _ : state) {
    TileProblem work = problem;
    TileState values = make_tile_state(work, start, std::vector<Eigen::Vector3d>(work.points.size(), unknown));
    summary = adjust_tile(work, values, adjust);
  }
  state.counters["points"] = static_cast<double>(summary.points);
  state.counters["observations"] = static_cast<double>(summary.observations);
  state.counters["sigma0"] = summary.sigma0;
}
BENCHMARK(adjust_aerial_tile)
    ->Args({18, 1900})
    ->Args({170, 3820})
    ->ArgNames({"images", "observations_per_image"})
    ->Unit(benchmark::kMillisecond)
    ->Iterations(1);

}  // namespace
}  // namespace megablock

BENCHMARK_MAIN();
