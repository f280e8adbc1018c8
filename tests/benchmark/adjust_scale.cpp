// Runs one job on a simulated block of any size, from given tie points to the evaluated result:
//
//   adjust_scale --scene street|aerial [--frames 1000] [--ranks 1] [--threads 1] [--memory 16] [--folder F]
//                [--seed 1] [--calibration held|shared] [--arithmetic avx2|avx512] [--plain]
//
// tests/benchmark/scenes.h describes the scenes. The program runs 'megablock simulate' and 'mpirun megablock run' and
// prints one JSON object as its last line. A block that --folder has already is not simulated again. The figures are:
//
//   seconds                     duration of the run by the wall clock
//   peak_rss_mib_per_rank       largest VmHWM of a rank, without the summary that is printed at the end
//   stage_peak_rss_mib          the same for each stage; that of the merge is without its result
//   leaf_seconds_per_image      time for the tiles (leaves) in one sweep up and down, sum of all ranks
//   front_seconds_per_iteration time for the fronts above them, mean of the ranks
//   peak_front_mib              largest memory of the fronts and updates of a rank
//   steps_tried                 number of accepted steps, of refused ones, and of those that confirm the optimum
//   seam_alarms                 number of lines of the result that report a disagreement of tiles
//   image_sigma_px              sigma of the tie points. The job estimates it, so chi2_per_dof tests it only with
//   --plain
//
// The figures of leaves, fronts and steps are those of the last round of the merge.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>

#include "io/base/error.h"
#include "io/evaluation/evaluate.h"
#include "io/result/track_batches.h"
#include "io/store/job/events.h"
#include "tests/benchmark/scenes.h"
#include "tests/support/io/scratch_directory.h"

namespace {

using namespace megablock;
namespace fs = std::filesystem;

struct ScaleOptions {
  SceneOptions scene;
  int ranks = 1, threads = 1;
  double memory_mib = 16;  // per rank, for tiles, fronts and factors of the merge
  std::string arithmetic = "avx2";
  bool plain = false;
};

// Nothing is estimated from residuals, nothing is cut from the tails of their distribution.
constexpr const char* kPlain =
    "adjustment: {image_sigma_px: 0.5, estimate_image_sigma: false, image_loss: none, position_loss: none, "
    "max_residual_sigmas: 8}\n";

// Median duration of the iterations, which include refused steps before an accepted one. Each accepted step leaves an
// event "merge/<round>-<accepted>" on the first rank. The end of a round leaves one with the last number once more.
double seconds_per_iteration(const fs::path& job) {
  std::vector<UnitEvent> events = read_events(JobStore(job.string()));
  std::stable_sort(events.begin(), events.end(),
                   [](const UnitEvent& a, const UnitEvent& b) { return a.time_s < b.time_s; });
  std::vector<double> seconds;
  std::string accepted;
  for (const UnitEvent& event : events) {
    if (event.rank != 0 || !event.unit.starts_with("merge/")) continue;
    const std::string now = event.unit.substr(event.unit.rfind('-'));
    if (std::exchange(accepted, now) != now) seconds.push_back(event.seconds);
  }
  if (seconds.empty()) throw ComputeError("the job has left no events of its merge");
  std::nth_element(seconds.begin(), seconds.begin() + std::ssize(seconds) / 2, seconds.end());
  return seconds[seconds.size() / 2];
}

// From the start of the stages to the checkpoint behind the last step.
double seconds_to_last_step(const fs::path& job, double start_s) {
  double last = start_s;
  for (const UnitEvent& event : read_events(JobStore(job.string())))
    if (event.rank == 0 && event.unit.starts_with("merge/")) last = std::max(last, event.time_s);
  return last - start_s;
}

// What the event that ends the merge says of its cost.
std::map<std::string, double> costs_of_merge(const fs::path& job) {
  std::map<std::string, double> figures;
  for (const UnitEvent& event : read_events(JobStore(job.string())))
    if (!event.figures.empty()) figures = event.figures;
  if (figures.empty()) throw ComputeError("the job has left no event of its result");
  return figures;
}

nlohmann::json by_stage(const BlockResult& result, double StageStatistics::*figure) {
  nlohmann::json figures = nlohmann::json::object();
  for (const StageStatistics& stage : result.stages) figures[stage.name] = stage.*figure;
  return figures;
}

// Points with kept observations in frames of several tiles.
std::int64_t points_across_tiles(const BlockResult& result, const TrackBatches& tracks) {
  std::int64_t count = 0;
  tracks.visit([&](const TrackResults& batch) {
    for (std::int64_t t = 0; t < batch.tracks.track_count(); ++t) {
      TileIndex first;
      bool across = false;
      for (std::int64_t o = batch.tracks.begin[t]; o < batch.tracks.begin[t + 1]; ++o) {
        if (!batch.kept[o]) continue;
        const TileIndex tile = result.tiles.tile_of_frame[result.block.images[batch.tracks.image[o]].frame];
        if (!first.valid()) first = tile;
        across = across || tile != first;
      }
      count += across;
    }
  });
  return count;
}

nlohmann::json measure(const ScaleOptions& options, const fs::path& folder) {
  const fs::path job = folder / ("job-" + std::to_string(options.ranks) + "x" + std::to_string(options.threads));
  simulate_scene(options.scene, folder, options.plain ? kPlain : "");
  const auto start = std::chrono::steady_clock::now();
  const double start_s = seconds_since_1970();
  run_scene(folder, job, options.ranks, options.threads,
            "--memory " + std::to_string(options.memory_mib) + " --arithmetic " + options.arithmetic);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();

  const BlockResult result = read_result_without_tracks((job / "result/block.h5").string());
  const StoredTracks tracks((job / "result/block.h5").string());
  const Evaluation evaluation = evaluate(result, (folder / "truth.csv").string());
  const ReprojectionStatistics statistics = reprojection_statistics(result, tracks);
  const double per_iteration = seconds_per_iteration(job);
  const std::map<std::string, double> costs = costs_of_merge(job);
  const double leaf_seconds = costs.at("tile_seconds") / costs.at("passes"),
               front_seconds = costs.at("front_seconds") / costs.at("passes");
  return {{"scene", options.scene.scene},
          {"frames", options.scene.frames},
          {"images", result.block.images.size()},
          {"ranks", options.ranks},
          {"threads", options.threads},
          {"observations", statistics.observations},
          {"observations_per_second_per_core",
           static_cast<double>(statistics.observations) / per_iteration / options.ranks / options.threads},
          {"arithmetic", options.arithmetic},
          {"seconds", seconds},
          {"seconds_to_last_step", seconds_to_last_step(job, start_s)},
          {"stage_seconds", by_stage(result, &StageStatistics::seconds)},
          {"seconds_per_iteration", per_iteration},
          {"global_iterations", result.global_iterations},
          {"chi2_per_dof", result.variance_factor},
          {"image_sigma_px", result.image_sigma_px},
          {"plain", options.plain},
          {"steps_tried", costs.at("tried_steps")},
          {"leaf_seconds_per_image", leaf_seconds / static_cast<double>(result.block.images.size())},
          {"front_seconds_per_iteration", front_seconds / options.ranks},
          {"root_unknowns", costs.at("root_unknowns")},
          {"widest_front", costs.at("widest_front")},
          {"front_operations", costs.at("front_operations")},
          {"peak_front_mib", costs.at("peak_front_mib")},
          {"tiles_in_scratch", costs.at("tiles_in_scratch")},
          {"seam_alarms", costs.at("seam_alarms")},
          {"peak_rss_mib_per_rank", costs.at("process_peak_rss_mib")},
          {"stage_peak_rss_mib", by_stage(result, &StageStatistics::peak_rss_mib)},
          {"boundary_frames", std::count(result.boundary.begin(), result.boundary.end(), std::uint8_t{1})},
          {"tiles", result.tiles.tile_count},
          {"points_across_tiles", points_across_tiles(result, tracks)},
          {"newton_decrement", result.newton_decrement},
          {"normalised_error_position", evaluation.normalised_error_position},
          {"normalised_error_rotation", evaluation.normalised_error_rotation},
          {"position_rms_m", evaluation.position_rms_m}};
}

}  // namespace

int main(int argc, char** argv) {
  ScaleOptions options;
  CLI::App app("One job on a simulated block of any size; prints one JSON object");
  add_scene_options(app, options.scene);
  app.add_option("--calibration", options.scene.calibration, "By default a street's is held, an aerial block's shared")
      ->check(CLI::IsMember({"held", "shared"}));
  app.add_option("--ranks", options.ranks, "MPI ranks")->check(CLI::Range(1, 1024));
  app.add_option("--threads", options.threads, "Threads per rank")->check(CLI::Range(1, 1024));
  app.add_option("--memory", options.memory_mib, "Memory per rank for tiles, fronts and factors, MiB")
      ->check(CLI::PositiveNumber);
  app.add_option("--arithmetic", options.arithmetic, "Of the job")->check(CLI::IsMember({"avx2", "avx512"}));
  app.add_flag("--plain", options.plain,
               "Sigma of tie points as simulated, no loss, next to nothing rejected: chi2_per_dof tests the noise");
  CLI11_PARSE(app, argc, argv);
  try {
    const ScratchDirectory scratch;
    const fs::path folder = options.scene.folder.empty() ? fs::path(scratch.path()) : options.scene.folder;
    std::printf("%s\n", measure(options, folder).dump().c_str());
  } catch (const std::exception& error) {
    std::fprintf(stderr, "adjust_scale: %s\n", error.what());
    return 1;
  }
  return 0;
}
