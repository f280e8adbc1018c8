// Measures one Levenberg-Marquardt iteration of a single tile with one thread, without a merge tree:
//   scene 0  a street of 300 frames of ten cameras, 1 000 observations per frame, five per point; calibration held
//   scene 1  the same; eight intrinsics and six mount unknowns of every camera shared by all frames
//   scene 2  500 aerial images, overlaps of 80 and 60 %, 300 observations each; the camera's eight intrinsics shared
// The parts are: condense (linearise, eliminate the points, factorise the cells of the tile), down (back-substitution),
// evaluate (points in the tail of the loss, cost of the new state). `iteration` is all of them in turn (MergeInMemory),
// with the datum and the new state. `from_scratch` reads a tile back from disk, which happens twice per iteration; the
// size of its files is printed beside it. The counter is observations per second of processor time.
//
//     bench_merge --benchmark_repetitions=5
#include <benchmark/benchmark.h>
#include <omp.h>

#include <limits>
#include <map>
#include <numbers>

#include "adjust/terms/build_problem.h"
#include "adjust/terms/linearise.h"
#include "io/simulate/blocks/simulate.h"
#include "merge/step/tile_store.h"
#include "merge/tile/point_refinement.h"
#include "merge/tree/merge_in_memory.h"
#include "tests/support/io/scratch_directory.h"

extern "C" void openblas_set_num_threads(int threads);

namespace megablock {
namespace {

enum Scene { kStreetHeld, kStreetShared, kAerial };

// Of the simulated camera seven intrinsics are free; here all eight are.
SimulatedBlock with_all_intrinsics(SimulatedBlock block) {
  for (Camera& camera : block.block.cameras)
    if (camera.prior_sigma[kFocal] > 0) camera.prior_sigma[kRadial3] = std::numeric_limits<double>::infinity();
  return block;
}

SimulatedBlock simulated(Scene scene) {
  SimulationOptions options;
  options.calibrate = scene != kStreetHeld;
  if (scene == kAerial) {
    options.frames = 500;
    options.attitude_sigma_deg = 0.02;
    return with_all_intrinsics(simulate_block(options));
  }
  options.scene = SimulationOptions::Scene::kStreet;
  options.frames = 300;
  options.rig_cameras = 10;
  options.points_per_frame = 1000;
  options.gps_sigma_m = 0.5;
  options.gps_share = 0.5;
  options.relative_position_sigma_m = 0.01;
  SimulatedBlock block = with_all_intrinsics(simulate_block(options));
  for (Mount& mount : block.block.rigs[RigIndex(0)].mounts) {
    mount.rotation_sigma_rad = scene == kStreetShared ? 0.1 * std::numbers::pi / 180 : 0;
    mount.position_sigma_m = scene == kStreetShared ? 0.005 : 0;
  }
  return block;
}

// A tile that is the whole block, with the true values as its state.
struct WholeTile {
  TileProblem problem;
  TileState state;
  TilePlan plan;
  MergeTree tree;

  explicit WholeTile(const SimulatedBlock& block) {
    openblas_set_num_threads(1);
    omp_set_num_threads(1);
    const Tiles one = single_tile(block.block);
    problem = make_tile_problem(block.block, block.truth, one, TileIndex(0), block.tracks, {});
    state = make_tile_state(problem, block.truth, block.points);
    tree = one.tree;
    plan = make_tile_plan(problem, make_plan(tree, {tile_unknowns(problem)}).nodes.front());
  }
};

const WholeTile& tile_of(const benchmark::State& state) {
  static std::map<std::int64_t, WholeTile> tiles;
  const std::int64_t scene = state.range(0);
  const auto made = tiles.find(scene);
  return made != tiles.end() ? made->second
                             : tiles.try_emplace(scene, simulated(static_cast<Scene>(scene))).first->second;
}

void count_observations(benchmark::State& state, const WholeTile& tile) {
  state.SetItemsProcessed(state.iterations() * tile.problem.observation_count());
  state.counters["observations"] = static_cast<double>(tile.problem.observation_count());
}

constexpr double kLambda = 1e-6;

void condense(benchmark::State& state) {
  const WholeTile& tile = tile_of(state);
  for (auto _ : state) benchmark::DoNotOptimize(condense_tile(tile.problem, tile.plan, tile.state, kLambda));
  count_observations(state, tile);
}

void down(benchmark::State& state) {
  const WholeTile& tile = tile_of(state);
  const TileCondensation condensed = condense_tile(tile.problem, tile.plan, tile.state, kLambda);
  for (auto _ : state)
    benchmark::DoNotOptimize(solve_tile_down(tile.problem, tile.plan, tile.state, kLambda, condensed.factor, {}));
  count_observations(state, tile);
}

void evaluate(benchmark::State& state) {
  const WholeTile& tile = tile_of(state);
  TileState values = tile.state;
  for (auto _ : state) benchmark::DoNotOptimize(refine_points(tile.problem, tile.plan, values));
  count_observations(state, tile);
}

void iteration(benchmark::State& state) {
  const WholeTile& tile = tile_of(state);
  MergeInMemory runner(tile.tree, {tile.problem}, {tile.state});
  for (auto _ : state) {
    benchmark::DoNotOptimize(runner.up(kLambda));
    benchmark::DoNotOptimize(runner.down(kLambda));
  }
  count_observations(state, tile);
}

// More than caches hold, as in a large block.
void from_scratch(benchmark::State& state) {
  constexpr std::int64_t kTiles = 16;
  const WholeTile& tile = tile_of(state);
  const ScratchDirectory scratch;
  MemoryOptions memory;
  memory.scratch = std::make_shared<ScratchSpace>(scratch.path("rank-0"));
  memory.tile_bytes = 0;
  TileStore tiles(memory);
  for (std::int64_t number = 0; number < kTiles; ++number) tiles.add({number, tile.problem, tile.state});
  std::size_t row = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(tiles.whole(row).problem.x.data());
    row = (row + 1) % kTiles;
  }
  count_observations(state, tile);
  state.counters["bytes_per_observation"] =
      static_cast<double>(memory.scratch->bytes()) / kTiles / static_cast<double>(tile.problem.observation_count());
}

void scenes(benchmark::internal::Benchmark* part) {
  part->ArgName("scene")->DenseRange(kStreetHeld, kAerial)->Unit(benchmark::kMillisecond);
}
BENCHMARK(condense)->Apply(scenes);
BENCHMARK(down)->Apply(scenes);
BENCHMARK(evaluate)->Apply(scenes);
BENCHMARK(iteration)->Apply(scenes);
BENCHMARK(from_scratch)->Apply(scenes);

}  // namespace
}  // namespace megablock

BENCHMARK_MAIN();
