// Compares the merge of a block in tiles with Ceres, which adjusts the block as one problem:
//
//   against_ceres --scene street|aerial [--frames 2000] [--seed 1] [--folder F] [--tile-frames 120]
//                 [--calibration held|shared] [--loss huber|cauchy|none] [--free] [--ranks 1|2] [--exactness|--speed]
//
// tests/benchmark/scenes.h describes the scenes. A job on that many ranks merges the block to a decrement of 1e-7. It
// gives the tiles, the kept observations and the solution.
//
// Exactness (cluster/outcome/monolithic_comparison.h; with --exactness only this part, with --speed only the other
// one): max_pose_difference_sigmas is the largest component, over its posterior sigma, of the undamped Newton step that
// one Ceres problem with automatic derivatives makes at the solution. relative_cost_difference is the part of the cost
// by which Ceres can still lower it from there, with all tolerances 1e-16.
//
// Speed: all runs start from the observations, points and sigmas of the same job, with every component of every pose
// moved by a normal deviate of its sigma. Each run is a process of its own and uses the best arithmetic of the
// processor. Ceres runs on two threads: with SPARSE_SCHUR by automatic and by analytic derivatives, and with
// ITERATIVE_SCHUR (Schur-Jacobi, three steps) by analytic ones. Before each of them, the merge runs three times, on one
// rank with two threads or on two ranks. The fastest run of Ceres counts, and the median one of ours.
//
// The last line is one JSON object with these figures:
//
//   relative_cost_difference_of_runs       (ours - Ceres') / Ceres' at the ends of the runs, for the best SPARSE_SCHUR
//   max_pose_difference_sigmas_of_runs     the same for the poses; Ceres stops a little before its optimum
//   seconds_per_iteration_ratio            Ceres' / ours, for its best setting, whose derivatives may be ours
//   seconds_per_iteration_ratio_automatic  the same for Ceres with its own derivatives
//   peak_memory_ratio                      Ceres' / ours, for its best setting
//
// and for all runs seconds_per_iteration (median by the wall clock, without reading and ordering),
// processor_seconds_per_iteration (sum of all threads or ranks), and peak_rss_mib (largest resident memory of the
// process; for two ranks of ours, their sum).
#include <ceres/ceres.h>
#include <omp.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "adjust/lanes/observation_lanes.h"
#include "adjust/terms/linearise.h"
#include "adjust/tile/ceres_problem.h"
#include "cluster/mpi/communicator.h"
#include "cluster/outcome/monolithic_comparison.h"
#include "cluster/process/arithmetic.h"
#include "cluster/process/process_memory.h"
#include "io/result/result.h"
#include "io/store/hdf5/hdf5_file.h"
#include "io/store/units/state_file.h"
#include "io/store/units/tracks_file.h"
#include "merge/tree/merge_tree_runner.h"
#include "tests/benchmark/against_ceres_start.h"
#include "tests/benchmark/scenes.h"
#include "tests/support/io/scratch_directory.h"

namespace {

using namespace megablock;
using Json = nlohmann::json;
namespace fs = std::filesystem;

constexpr int kThreads = 2;  // in all, of either side

double median(std::vector<double> values) {
  if (values.empty()) throw ComputeError("no iteration was made");
  std::nth_element(values.begin(), values.begin() + std::ssize(values) / 2, values.end());
  return values[values.size() / 2];
}

// Wall clock and processor time between successive steps.
class Steps {
 public:
  void add() {
    const auto now = std::chrono::steady_clock::now();
    const std::clock_t processor = std::clock();
    wall_.push_back(std::chrono::duration<double>(now - last_).count());
    processor_.push_back(static_cast<double>(processor - last_processor_) / CLOCKS_PER_SEC);
    last_ = now;
    last_processor_ = processor;
  }
  void put(Json& figures) const {
    figures["seconds_per_iteration"] = median(wall_);
    figures["processor_seconds_per_iteration"] = median(processor_);
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
  std::clock_t last_processor_ = std::clock();
  std::vector<double> wall_, processor_;
};

struct Options {
  SceneOptions scene;
  std::string role;  // of a process that this program starts: "exactness", "ours" or the name of Ceres' linear solver
  bool analytic = false;
  bool exactness = true, speed = true;  // what is asked for
  int ranks = 1;                        // of ours: one with two threads, or two with a thread each
  int tile_frames = 120;                // so that ranks have several; 0: as the program chooses
  std::string loss = "huber";
  Options() { scene.frames = 2000; }
};

std::int64_t kept_observations(const TileProblem& problem) {
  return std::count(problem.kept.begin(), problem.kept.end(), std::uint8_t{1});
}

// The poses that a process has at the end: its frames count as oriented.
void write_end(const std::string& path, BlockState state, const std::vector<const RankTile*>& tiles) {
  std::fill(state.oriented.begin(), state.oriented.end(), std::uint8_t{0});
  for (const RankTile* own : tiles) {
    const RankTile& tile = *own;
    for (std::size_t f = 0; f < tile.problem.frames.size(); ++f) {
      state.frames[tile.problem.frames[f]] = tile.state.frames[f];
      state.oriented[tile.problem.frames[f]] = 1;
    }
  }
  write_state(path, state);
}

// Our side, on as many ranks as it was started on; each leaves its figures.
void run_ours(const Start& start, Communicator& ranks) {
  const Inputs inputs(start);
  std::vector<std::int64_t> observations;
  for (std::int64_t t = 0; t < inputs.tiles.tile_count; ++t)
    observations.push_back(static_cast<std::int64_t>(fs::file_size(start.tracks(t))));
  const std::vector<int> rank_of_tile = distribute_tiles(inputs.tiles.tree, observations, ranks.size());
  TileStore tiles{MemoryOptions()};
  std::int64_t own = 0;
  for (std::int64_t t = 0; t < inputs.tiles.tile_count; ++t)
    if (rank_of_tile[static_cast<std::size_t>(t)] == ranks.rank()) {
      tiles.add(inputs.tile(inputs.tiles, TileIndex(t), read_tracks(start.tracks(t)), read_points(start.points(t))));
      own += kept_observations(tiles.outline(tiles.size() - 1).problem);
    }
  omp_set_num_threads(kThreads / ranks.size());
  MergeTreeRunner runner(ranks, inputs.tiles.tree, rank_of_tile, tiles, MemoryOptions());
  GlobalOptions options;
  options.max_decrement = 1e-6;
  GlobalState state = start_global(options);
  Steps steps;
  std::int32_t seen = 0;
  adjust_globally(runner, options, state, [&](const GlobalState& now) {
    if (now.iterations > seen) steps.add();  // else the end
    seen = now.iterations;
  });
  std::vector<const RankTile*> outlines;
  for (std::size_t row = 0; row < tiles.size(); ++row) outlines.push_back(&tiles.outline(row));
  write_end(start.file("end-" + std::to_string(ranks.rank()) + ".h5"), inputs.state, outlines);
  Json figures{{"cost", state.cost},
               {"start_cost", state.initial_cost},
               {"iterations", state.iterations},
               {"observations", own},
               {"peak_rss_mib", peak_rss_mib()}};
  steps.put(figures);
  std::ofstream(start.file("ours-" + std::to_string(ranks.rank()) + ".json")) << figures;
}

// All tiles' tracks as one, ascending.
RankTile whole_block(const Start& start, const Inputs& inputs) {
  TrackSet all;
  all.begin = {0};
  std::vector<Eigen::Vector3d> points;
  {
    std::vector<TrackSet> parts;
    std::vector<std::vector<Eigen::Vector3d>> positions;
    std::vector<std::tuple<TrackIndex, std::size_t, std::size_t>> order;
    for (std::int64_t t = 0; t < inputs.tiles.tile_count; ++t) {
      parts.push_back(read_tracks(start.tracks(t)));
      positions.push_back(read_points(start.points(t)));
      for (std::size_t row = 0; row < parts.back().id.size(); ++row)
        order.emplace_back(parts.back().id[row], parts.size() - 1, row);
    }
    std::sort(order.begin(), order.end());
    for (const auto& [id, part, row] : order) {
      const TrackSet& from = parts[part];
      for (auto o = static_cast<std::size_t>(from.begin[row]); o < static_cast<std::size_t>(from.begin[row + 1]); ++o) {
        all.image.push_back(from.image[o]);
        all.x.push_back(from.x[o]);
        all.y.push_back(from.y[o]);
        all.feature.push_back(from.feature[o]);
      }
      all.id.push_back(id);
      all.begin.push_back(all.observation_count());
      points.push_back(positions[part][row]);
    }
  }
  return inputs.tile(single_tile(inputs.block), TileIndex(0), all, std::move(points));
}

// Called behind every step, and first behind the evaluation of the start.
class StepWatch : public ceres::IterationCallback {
 public:
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& summary) override {
    if (summary.iteration == 0) steps = Steps();
    if (summary.iteration > 0) steps.add();
    return ceres::SOLVER_CONTINUE;
  }
  Steps steps;
};

void run_ceres(const Start& start, const Options& options) {
  const Inputs inputs(start);
  RankTile tile = whole_block(start, inputs);
  CeresTile problem(
      tile.problem, tile.state,
      {options.analytic ? CeresOptions::Derivatives::kAnalytic : CeresOptions::Derivatives::kAutomatic, {}});
  ceres::Solver::Options solver;
  if (!ceres::StringToLinearSolverType(options.role, &solver.linear_solver_type))
    throw InputError(options.role + ": no such solver");
  if (solver.linear_solver_type == ceres::ITERATIVE_SCHUR) solver.preconditioner_type = ceres::SCHUR_JACOBI;
  solver.linear_solver_ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  std::vector<double*> blocks;
  problem.problem().GetParameterBlocks(&blocks);
  for (double* block : blocks) solver.linear_solver_ordering->AddElementToGroup(block, problem.is_point(block) ? 0 : 1);
  solver.function_tolerance = solver.gradient_tolerance = solver.parameter_tolerance = 1e-16;
  const bool direct = solver.linear_solver_type == ceres::SPARSE_SCHUR;
  solver.max_num_iterations = direct ? 12 : 3;  // of the other only the speed is asked
  StepWatch watch;
  solver.callbacks = {&watch};
  solver.num_threads = kThreads;
  solver.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem.problem(), &summary);
  if (!summary.IsSolutionUsable()) throw ComputeError("Ceres: " + summary.message);
  const double peak = peak_rss_mib();
  problem.store(tile.state);
  const std::string name = options.role + (options.analytic ? "-analytic" : "-automatic");
  Json figures{{"solver", options.role},
               {"derivatives", options.analytic ? "analytic" : "automatic"},
               {"cost", summary.final_cost},
               {"start_cost", summary.initial_cost},
               {"iterations", summary.iterations.size() - 1},
               {"observations", kept_observations(tile.problem)},
               {"peak_rss_mib", peak}};
  watch.steps.put(figures);
  std::ofstream(start.file(name + ".json")) << figures;
  write_end(start.file("end-" + name + ".h5"), inputs.state, {&tile});
}

Json json_of(const std::string& path) {
  std::ifstream in(path);
  return Json::parse(in);
}

Json figures_of_ours(const Start& start) {
  Json ours = json_of(start.file("ours-0.json"));
  for (int r = 1; r < start.ranks; ++r) {
    const Json other = json_of(start.file("ours-" + std::to_string(r) + ".json"));
    ours["observations"] = ours["observations"].get<std::int64_t>() + other["observations"].get<std::int64_t>();
    for (const char* figure : {"peak_rss_mib", "processor_seconds_per_iteration"})
      ours[figure] = ours[figure].get<double>() + other[figure].get<double>();
  }
  ours["solver"] = "megablock, ranks: " + std::to_string(start.ranks);
  return ours;
}

double pose_difference_sigmas(const Start& start, const BlockResult& result, const std::string& ceres_end) {
  const BlockState ceres = read_state(ceres_end);
  double largest = 0;
  for (int r = 0; r < start.ranks; ++r) {
    const BlockState ours = read_state(start.file("end-" + std::to_string(r) + ".h5"));
    for (FrameIndex f(0); ours.frames.contains(f); ++f.value) {
      if (!ours.oriented[f]) continue;
      const Pose &a = ceres.frames[f], &b = ours.frames[f];
      PoseIncrement d;
      d << rotation_log<double>(a.rotation.conjugate() * b.rotation), b.centre - a.centre;
      for (int k = 0; k < 6; ++k) {
        const double share = std::abs(d[k]) / std::sqrt(result.frame_covariance[f](k, k));
        if (!std::isfinite(share)) throw ComputeError("a pose or its sigma is not a number");
        largest = std::max(largest, share);
      }
    }
  }
  return largest;
}

void run_job(const Options& options, const Start& start) {
  std::string project =
      "adjustment: {image_loss: " + options.loss + ", position_loss: " + options.loss + "}\nmerge: {decrement: 1e-7}\n";
  if (options.tile_frames > 0) project += "tiles: {tile_max_frames: " + std::to_string(options.tile_frames) + "}\n";
  simulate_scene(options.scene, start.folder, project);
  run_scene(start.folder, start.job(), start.ranks, kThreads / start.ranks);
}

Json exactness(const Start& start, const std::string& self) {
  run_command(self + "exactness");
  return json_of(start.file("exactness.json"));
}

Json speed(const Options& options, const Start& start, const std::string& self) {
  const BlockResult result = read_result((start.job() / "result/block.h5").string());
  write_start(start, result, options.scene.seed);
  const std::string merge = on_ranks(start.ranks) + self + "ours " + kArithmeticOption +
                            (lane_kernels_of_width(8) != nullptr ? " avx512" : " avx2");
  std::vector<Json> own_runs, runs;
  for (const std::string run : {"SPARSE_SCHUR", "SPARSE_SCHUR --analytic", "ITERATIVE_SCHUR --analytic"}) {
    for (int repetition = 0; repetition < 3; ++repetition) {  // each takes a tenth of Ceres' time
      run_command(merge);
      own_runs.push_back(figures_of_ours(start));
    }
    run_command(self + run);
    const bool analytic = run.ends_with("--analytic");
    runs.push_back(
        json_of(start.file(run.substr(0, run.find(' ')) + (analytic ? "-analytic" : "-automatic") + ".json")));
  }
  const auto faster = [](const Json& a, const Json& b) {
    return a["seconds_per_iteration"].get<double>() < b["seconds_per_iteration"].get<double>();
  };
  std::sort(own_runs.begin(), own_runs.end(), faster);
  const Json ours = own_runs[own_runs.size() / 2];
  const Json best = *std::min_element(runs.begin(), runs.end(), faster);
  const Json direct = *std::min_element(runs.begin(), runs.begin() + 2, faster);
  const auto ratio = [&](const char* figure) { return best[figure].get<double>() / ours[figure].get<double>(); };
  const double ceres_cost = direct["cost"];
  return {{"relative_cost_difference_of_runs", (ours["cost"].get<double>() - ceres_cost) / ceres_cost},
          {"max_pose_difference_sigmas_of_runs",
           pose_difference_sigmas(start, result,
                                  start.file("end-SPARSE_SCHUR-" + direct["derivatives"].get<std::string>() + ".h5"))},
          {"seconds_per_iteration_ratio", ratio("seconds_per_iteration")},
          {"seconds_per_iteration_ratio_automatic",
           runs.front()["seconds_per_iteration"].get<double>() / ours["seconds_per_iteration"].get<double>()},
          {"processor_seconds_per_iteration_ratio", ratio("processor_seconds_per_iteration")},
          {"peak_memory_ratio", ratio("peak_rss_mib")},
          {"ours", ours},
          {"ceres", best},
          {"ceres_runs", runs}};
}

Json compare(const Options& options, const fs::path& folder) {
  const Start start{folder, options.ranks};
  run_job(options, start);
  fs::create_directories(folder / "start");
  const std::string self =
      "'" + fs::canonical("/proc/self/exe").string() + "' --folder '" + folder.string() + "' --role ";
  Json figures{{"scene", options.scene.scene},      {"frames", options.scene.frames},
               {"seed", options.scene.seed},        {"calibration", options.scene.calibration},
               {"free", options.scene.free},        {"loss", options.loss},
               {"tile_frames", options.tile_frames}};
  if (options.exactness) figures.update(exactness(start, self));
  if (options.speed) figures.update(speed(options, start, self));
  return figures;
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app("The merge against Ceres on one simulated block; prints one JSON object");
  add_scene_options(app, options.scene);
  app.add_option("--tile-frames", options.tile_frames, "Frames per tile at most; 0: as the program chooses");
  app.add_option("--ranks", options.ranks, "Ranks of ours: one with two threads, or two with a thread each [1]")
      ->check(CLI::Range(1, 2));
  app.add_option("--calibration", options.scene.calibration, "Calibration held, or shared by all frames and adjusted")
      ->check(CLI::IsMember({"held", "shared"}));
  app.add_option("--loss", options.loss, "Robust loss of image measurements and positions")
      ->check(CLI::IsMember({"none", "huber", "cauchy"}));
  app.add_flag("--free", options.scene.free, "Without positions and attitudes");
  CLI::Option* exact = app.add_flag("!--speed", options.exactness, "Only how fast the solution is found");
  app.add_flag("!--exactness", options.speed, "Only how exact it is")->excludes(exact);
  app.add_option("--role", options.role)->group("");
  app.add_flag("--analytic", options.analytic)->group("");
  app.add_option(kArithmeticOption)->group("");  // pin_arithmetic() reads it
  CLI11_PARSE(app, argc, argv);
  try {
    const Start start{options.scene.folder, options.ranks};
    if (options.role == "ours") {
      pin_arithmetic(argc, argv);
      limit_libraries_to_one_thread();
      Communicator ranks(&argc, &argv);
      run_ours(start, ranks);
    } else if (options.role == "exactness") {
      pin_arithmetic(argc, argv);
      limit_libraries_to_one_thread();
      std::ofstream(start.file("exactness.json")) << compare_with_monolithic(JobStore(start.job().string()));
    } else if (!options.role.empty()) {
      run_ceres(start, options);
    } else {
      const ScratchDirectory scratch;
      const fs::path folder = options.scene.folder.empty() ? fs::path(scratch.path()) : options.scene.folder;
      std::printf("%s\n", compare(options, folder).dump().c_str());
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "against_ceres: %s\n", error.what());
    return 1;
  }
  return 0;
}
