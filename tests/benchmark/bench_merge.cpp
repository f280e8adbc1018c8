// One Levenberg-Marquardt iteration of a tile, one thread: a street of 300 frames of ten cameras, 1 000 observations
// per frame, five per point, with its own cells and nothing passed to a merge tree. Calibration held, or the eight
// intrinsics and the six mount unknowns of the ten cameras shared by all frames.
//
// Parts: condense (linearise, eliminate points, factorise the cells), down (back-substitute), evaluate (points in the
// tail of the loss, cost of the new state); iteration: all of them as the merge runs them, with the datum and the new
// state. The counter is observations per second of processor time.
//
//     bench_merge --benchmark_repetitions=5 --benchmark_report_aggregates_only=false
#include <benchmark/benchmark.h>

#include <numbers>

#include "adjust/linearise.h"
#include "io/simulate/simulate.h"
#include "merge/point_refinement.h"
#include "merge/serial_runner.h"

extern "C" void openblas_set_num_threads(int threads);

namespace megablock {
namespace {

// A tile that is the whole block, with the true values as its state.
struct StreetTile {
  TileProblem problem;
  TileState state;
  TilePlan plan;
  MergeTree tree;

  explicit StreetTile(bool shared) {
    openblas_set_num_threads(1);
    SimulationOptions options;
    options.scene = SimulationOptions::Scene::kStreet;
    options.frames = 300;
    options.rig_cameras = 10;
    options.points_per_frame = 1000;
    options.calibrate = shared;
    options.gps_sigma_m = 0.5;
    options.gps_share = 0.5;
    options.relative_position_sigma_m = 0.01;
    SimulatedBlock simulated = simulate_block(options);
    for (Mount& mount : simulated.block.rigs[RigIndex(0)].mounts) {
      mount.rotation_sigma_rad = shared ? 0.1 * std::numbers::pi / 180 : 0;
      mount.position_sigma_m = shared ? 0.005 : 0;
    }
    const Tiles one = single_tile(simulated.block);
    problem = make_tile_problem(simulated.block, simulated.truth, one, TileIndex(0), simulated.tracks, {});
    state = make_tile_state(problem, simulated.truth, simulated.points);
    tree = one.tree;
    plan = make_tile_plan(problem, make_plan(tree, {tile_unknowns(problem)}).nodes.front());
  }
};

const StreetTile& tile_of(const benchmark::State& state) {
  static const StreetTile held(false), shared(true);
  return state.range(0) != 0 ? shared : held;
}

void count_observations(benchmark::State& state, const StreetTile& tile) {
  state.SetItemsProcessed(state.iterations() * tile.problem.observation_count());
  state.counters["observations"] = static_cast<double>(tile.problem.observation_count());
}

constexpr double kLambda = 1e-6;

void condense(benchmark::State& state) {
  const StreetTile& tile = tile_of(state);
  for (auto _ : state) benchmark::DoNotOptimize(condense_tile(tile.problem, tile.plan, tile.state, kLambda));
  count_observations(state, tile);
}

void down(benchmark::State& state) {
  const StreetTile& tile = tile_of(state);
  const TileCondensation condensed = condense_tile(tile.problem, tile.plan, tile.state, kLambda);
  for (auto _ : state)
    benchmark::DoNotOptimize(solve_tile_down(tile.problem, tile.plan, tile.state, kLambda, condensed.factor, {}));
  count_observations(state, tile);
}

void evaluate(benchmark::State& state) {
  const StreetTile& tile = tile_of(state);
  TileState values = tile.state;
  for (auto _ : state) {
    refine_points(tile.problem, tile.plan, values);
    benchmark::DoNotOptimize(evaluate_cost(tile.problem, values));
  }
  count_observations(state, tile);
}

void iteration(benchmark::State& state) {
  const StreetTile& tile = tile_of(state);
  SerialRunner runner(tile.tree, {tile.problem}, {tile.state});
  for (auto _ : state) {
    benchmark::DoNotOptimize(runner.up(kLambda));
    benchmark::DoNotOptimize(runner.down(kLambda));
  }
  count_observations(state, tile);
}

void street(benchmark::internal::Benchmark* part) {
  part->ArgName("shared")->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);
}
BENCHMARK(condense)->Apply(street);
BENCHMARK(down)->Apply(street);
BENCHMARK(evaluate)->Apply(street);
BENCHMARK(iteration)->Apply(street);

}  // namespace
}  // namespace megablock

BENCHMARK_MAIN();
