// The merge: exact block-wise compensation of all tiles over all ranks (design: merge.md), then the result.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>

#include "adjust/image_sigma.h"
#include "adjust/sigma_scales.h"
#include "cluster/collective.h"
#include "cluster/matrix_bytes.h"
#include "cluster/process_memory.h"
#include "cluster/progress.h"
#include "cluster/rank_runner.h"
#include "cluster/signals.h"
#include "cluster/stages/assemble_result.h"
#include "cluster/stages/block_image_sigma.h"
#include "cluster/stages/merge_checkpoint.h"
#include "cluster/stages/merge_start.h"
#include "cluster/stages/provenance.h"
#include "cluster/stages/stages.h"
#include "io/error.h"
#include "io/hash.h"
#include "io/report.h"
#include "io/unit_files.h"

namespace megablock {

namespace {

constexpr const char* kResult = "result/block.h5";

struct MergeInputs {
  const BlockState& oriented;
  const Tiles& tiles;
  const std::vector<std::string>& tracks;
  const std::vector<std::string>& adjusted;
};

std::uint64_t inputs_fingerprint(const Job& job, const MergeInputs& inputs) {
  Hasher hasher;
  hasher.add(algorithm::kMerge);
  add_to_hash(hasher, job.settings.merge);
  add_to_hash(hasher, job.settings.adjustment);
  hasher.add(job.store.seal("block.h5")->content_hash).add(job.store.seal("tiles.h5")->content_hash);
  for (const std::string& name : inputs.tracks) hasher.add(job.store.seal(name)->content_hash);
  for (const std::string& name : inputs.adjusted)
    hasher.add(name.empty() ? std::uint64_t{0} : job.store.seal(name)->content_hash);
  return hasher.value();
}

// The block's state from all ranks' tiles. Tiles hold the same bits of what they share, so their order does not matter.
BlockState gather_state(Job& job, const BlockState& start, const std::vector<RankTile>& tiles) {
  ByteWriter writer;
  for (const RankTile& tile : tiles) {
    // What no kept residual of the tile touches has not moved with the block.
    const UnknownList touched = tile_unknowns(tile.problem);
    const auto write = [&](const auto& table, const auto& values, auto&& id_of, auto&& write_values) {
      std::decay_t<decltype(table)> rows;
      std::decay_t<decltype(values)> their;
      for (std::size_t row = 0; row < table.size(); ++row) {
        if (find_unknown(touched, id_of(table[row])) < 0) continue;
        rows.push_back(table[row]);
        their.push_back(values[row]);
      }
      writer.values(rows);
      write_values(their);
    };
    const auto as_poses = [&](const std::vector<Pose>& poses) { write_poses(writer, poses); };
    writer.values(tile.problem.frames);
    write(
        tile.problem.frames, tile.state.frames,
        [](FrameIndex f) {
          return UnknownId{UnknownKind::kFrame, 0, f.value};
        },
        as_poses);
    write(
        tile.problem.cameras, tile.state.cameras,
        [](CameraIndex c) {
          return UnknownId{UnknownKind::kCamera, 0, c.value};
        },
        [&](const std::vector<Intrinsics>& values) { writer.values(values); });
    write(
        tile.problem.mounts, tile.state.mounts,
        [](const MountId& m) {
          return UnknownId{UnknownKind::kMount, m.mount, m.rig.value};
        },
        as_poses);
  }
  const Bytes mine = writer.take();
  BlockState state = start;
  std::fill(state.oriented.begin(), state.oriented.end(), std::uint8_t{0});
  for (const std::string& text : job.ranks.gather_all(std::string(mine.begin(), mine.end()))) {
    const Bytes bytes(text.begin(), text.end());
    ByteReader reader(bytes);
    while (!reader.at_end()) {
      for (const FrameIndex frame : reader.values<FrameIndex>()) state.oriented[frame] = start.oriented[frame];
      const auto frames = reader.values<FrameIndex>();
      const auto poses = read_poses(reader);
      for (std::size_t f = 0; f < frames.size(); ++f) state.frames[frames[f]] = poses[f];
      const auto cameras = reader.values<CameraIndex>();
      const auto intrinsics = reader.values<Intrinsics>();
      for (std::size_t c = 0; c < cameras.size(); ++c) state.cameras[cameras[c]] = intrinsics[c];
      const auto mounts = reader.values<MountId>();
      const auto mount_poses = read_poses(reader);
      for (std::size_t m = 0; m < mounts.size(); ++m)
        state.mounts[mounts[m].rig][static_cast<std::size_t>(mounts[m].mount)] = mount_poses[m];
    }
  }
  return state;
}

// Every tile takes over what others have moved: before observations are tested against it.
void follow(const BlockState& state, std::vector<RankTile>& tiles) {
  for (RankTile& tile : tiles) tile.state = make_tile_state(tile.problem, state, std::move(tile.state.points));
}

std::vector<RankTile> load_own_tiles(const Job& job, const MergeInputs& inputs, const BlockState& start,
                                     const std::vector<int>& rank_of_tile) {
  std::vector<RankTile> own;
  for (std::size_t t = 0; t < rank_of_tile.size(); ++t) {
    if (rank_of_tile[t] != job.ranks.rank()) continue;
    MergeTile tile = load_merge_tile(job, start, inputs.tiles, TileIndex(static_cast<std::int64_t>(t)),
                                     inputs.tracks[t], inputs.adjusted[t]);
    own.push_back({static_cast<std::int64_t>(t), std::move(tile.problem), std::move(tile.state)});
  }
  return own;
}

std::vector<std::int64_t> observation_counts(const Job& job, const MergeInputs& inputs) {
  std::vector<std::int64_t> counts;
  for (const std::string& name : inputs.tracks)
    counts.push_back(static_cast<std::int64_t>(job.store.seal(name)->length));
  return counts;
}

int most_rounds(const MergeSettings& settings) {
  constexpr int kSigmaRounds = 10;
  return settings.estimate_sigmas ? std::max(settings.screening_rounds, kSigmaRounds) : settings.screening_rounds;
}

// Whether the sigmas of positions, attitudes and relative poses have changed enough to matter. Collective.
bool adopt_sigma_scales(RankRunner& runner, SigmaScales& scales) {
  const SigmaScales change = next_sigma_scales(scales, runner.posterior().observations);
  if (!change.matter()) return false;
  for (std::size_t k = 0; k < kObservationKinds; ++k) scales.of[k] *= change.of[k];
  for (RankTile& tile : runner.tiles()) scale_sigmas(tile.problem, change);
  return true;
}

// Re-tests every observation at the solution; how many verdicts changed in the whole block.
std::int64_t screen(Job& job, RankRunner& runner) {
  std::int64_t changed = 0;
  for (RankTile& tile : runner.tiles())
    changed += screen_observations(tile.problem, tile.state,
                                   screening_threshold(tile.problem, tile.state, job.settings.adjustment),
                                   job.settings.adjustment);
  std::int64_t total = 0;
  for (const std::string& text : job.ranks.gather_all(std::to_string(changed))) total += std::stoll(text);
  return total;
}

MemoryOptions memory_options(const Job& job) {
  MemoryOptions memory;
  memory.factor_bytes = static_cast<std::int64_t>(job.options.memory_mib * 1024 * 1024);
  memory.scratch_directory = job.store.path("scratch/rank-" + std::to_string(job.ranks.rank()));
  if (job.options.scratch_mib >= 0)
    memory.scratch_bytes = static_cast<std::int64_t>(job.options.scratch_mib * 1024 * 1024);
  return memory;
}

// Before a run (a killed one may have left files) and after it. The folder itself stays where another disk is mounted.
void clear_scratch(Job& job) {
  on_first_rank(job.ranks, [&] {
    const std::filesystem::path folder(job.store.path("scratch"));
    std::error_code ignored;
    for (const auto& entry : std::filesystem::directory_iterator(folder, ignored))
      std::filesystem::remove_all(entry.path());
    std::filesystem::remove(folder, ignored);
    return std::string();
  });
}

// Collective: what `--memory` led to, over all ranks.
void say_memory(Job& job, const MemoryStatistics& mine) {
  MemoryStatistics all;
  for (const std::string& text : job.ranks.gather_all(std::string(reinterpret_cast<const char*>(&mine), sizeof mine))) {
    MemoryStatistics some;
    std::memcpy(&some, text.data(), sizeof some);
    all.put += some.put;
    all.spilled += some.spilled;
    all.recomputed += some.recomputed;
    all.peak_bytes = std::max(all.peak_bytes, some.peak_bytes);
  }
  if (!job.is_first_rank() || job.options.quiet) return;
  std::fprintf(stderr,
               "merge        factors: %lld made, %lld spilled to scratch, %lld subtrees computed again, at most %.1f "
               "MiB on a rank\n",
               static_cast<long long>(all.put), static_cast<long long>(all.spilled),
               static_cast<long long>(all.recomputed), static_cast<double>(all.peak_bytes) / (1 << 20));
}

struct Adjusted {
  std::vector<RankTile> tiles;
  RankRunner::Posterior posterior;
  double image_sigma_px = 0;  // of tie point measurements
  MergePosition position;
  BlockState state;
  bool converged = false;
};

void say_iteration(const Job& job, const GlobalState& state) {
  if (!job.is_first_rank() || job.options.quiet) return;
  std::fprintf(stderr, "merge        %s\n", describe(state).c_str());
}

Adjusted adjust_block(Job& job, const MergeInputs& inputs, MergeCheckpoint& checkpoint) {
  const std::vector<int> rank_of_tile =
      distribute_tiles(inputs.tiles.tree, observation_counts(job, inputs), job.ranks.size());
  GlobalOptions options;
  options.max_decrement = job.settings.merge.decrement;
  options.max_iterations = job.settings.merge.max_iterations;

  std::optional<MergePosition> found = checkpoint.find();
  BlockState block = found ? checkpoint.state() : merge_start(job, inputs.oriented, inputs.adjusted);
  std::vector<RankTile> tiles = load_own_tiles(job, inputs, block, rank_of_tile);
  if (found) {
    for (RankTile& tile : tiles) {
      checkpoint.load_tile(tile);
      scale_sigmas(tile.problem, found->scales);
    }
  } else {
    const double sigma = start_image_sigma(job, inputs.adjusted);
    for (RankTile& tile : tiles) set_image_sigma(tile.problem, sigma);
  }

  Adjusted adjusted;
  MergePosition& position = adjusted.position;
  position = found ? *found : MergePosition{0, start_global(options), {}};
  std::int32_t saved = position.global.accepted;
  for (;;) {
    RankRunner runner(job.ranks, inputs.tiles.tree, rank_of_tile, std::move(tiles), memory_options(job));
    adjust_globally(runner, options, position.global, [&](const GlobalState& state) {
      say_iteration(job, state);
      if (state.accepted != saved) {
        saved = state.accepted;
        position.global = state;
        checkpoint.write(position, runner.tiles(), gather_state(job, block, runner.tiles()));
      }
      if (job.ranks.any(stop_requested()))
        throw AgreedError<Interrupted>("stopped in stage 'merge' as asked; run the same command to resume");
    });
    adjusted.converged = position.global.outcome == GlobalOutcome::kConverged ||
                         position.global.outcome == GlobalOutcome::kRoundingFloor;
    block = gather_state(job, block, runner.tiles());
    follow(block, runner.tiles());
    const bool last = position.round >= most_rounds(job.settings.merge);
    bool reweighted = !last && adopt_image_sigma(job, runner.tiles(), rank_of_tile.size(), block);
    if (!last && job.settings.merge.estimate_sigmas)
      reweighted = adopt_sigma_scales(runner, position.scales) || reweighted;
    if (last || (screen(job, runner) == 0 && !reweighted)) {
      adjusted.posterior = runner.posterior();
      say_memory(job, runner.memory());
      adjusted.tiles = std::move(runner.tiles());
      break;
    }
    tiles = std::move(runner.tiles());
    ++position.round;
    const std::int32_t accepted = position.global.accepted;
    position.global = start_global(options);
    position.global.accepted = accepted;
    checkpoint.write(position, tiles, block);
  }
  adjusted.state = std::move(block);
  adjusted.image_sigma_px = common_image_sigma(job, adjusted.tiles);
  return adjusted;
}

// The block's covariances of frames and cameras, from the tiles that hold them (all hold the same bits).
void add_covariances(const Adjusted& adjusted, MergeOutcome& outcome, const Block& block) {
  outcome.frame_covariance.assign(block.frames.size(), BlockResult::Matrix6::Zero());
  for (const Camera& camera : block.cameras)
    outcome.camera_covariance.push_back(Eigen::MatrixXd::Zero(camera.intrinsics.size(), camera.intrinsics.size()));
  for (std::size_t t = 0; t < adjusted.tiles.size(); ++t) {
    const TileProblem& problem = adjusted.tiles[t].problem;
    const TileCovariance& covariance = adjusted.posterior.covariances[t];
    for (std::size_t f = 0; f < problem.frames.size(); ++f)
      if (!covariance.frames[f].isZero(0)) outcome.frame_covariance[problem.frames[f]] = covariance.frames[f];
    for (std::size_t c = 0; c < problem.cameras.size(); ++c)
      if (!covariance.cameras[c].isZero(0)) outcome.camera_covariance[problem.cameras[c]] = covariance.cameras[c];
  }
}

std::vector<SeamCheck> seam_checks(const RankRunner::Posterior& posterior) {
  const std::vector<std::string> alarms = describe_seams(posterior.seams, posterior.tile_checks);
  std::vector<SeamCheck> checks;
  std::size_t alarm = 0;
  for (const SeamReport& seam : posterior.seams) {
    SeamCheck check{seam.node, seam.statistic, seam.degrees, seam.threshold, ""};
    if (seam.alarm() && alarm < alarms.size()) check.note = alarms[alarm++];
    checks.push_back(check);
  }
  return checks;
}

// What rank 0 needs of the other ranks' tiles for the result.
std::vector<TileResult> gather_parts(Job& job, const MergeInputs& inputs, Adjusted& adjusted, MergeOutcome& outcome) {
  add_covariances(adjusted, outcome, job.block);
  constexpr int kTag = 1 << 20;
  std::vector<TileResult> parts(inputs.tracks.size());
  const auto part_of = [&](std::size_t row) {
    const RankTile& tile = adjusted.tiles[row];
    const auto number = static_cast<std::size_t>(tile.tile);
    MergeTile merge{TileIndex(tile.tile), read_split_tracks(job, inputs.tracks[number], inputs.adjusted[number]),
                    tile.problem, tile.state};
    return make_tile_result(merge, adjusted.posterior.covariances[row].points);
  };
  if (!job.is_first_rank()) {
    for (std::size_t row = 0; row < adjusted.tiles.size(); ++row)
      job.ranks.send(0, kTag + static_cast<int>(adjusted.tiles[row].tile), to_bytes(part_of(row)));
    ByteWriter writer;
    write_matrices<BlockResult::Matrix6>(writer, outcome.frame_covariance);
    for (const Eigen::MatrixXd& covariance : outcome.camera_covariance) write_matrix(writer, covariance);
    const Bytes bytes = writer.take();
    job.ranks.send(0, kTag - 1, std::string(bytes.begin(), bytes.end()));
    job.ranks.flush_sends();
    return parts;
  }
  const std::vector<int> rank_of_tile =
      distribute_tiles(inputs.tiles.tree, observation_counts(job, inputs), job.ranks.size());
  for (std::size_t t = 0, own = 0; t < parts.size(); ++t)
    parts[t] = rank_of_tile[t] == 0
                   ? part_of(own++)
                   : tile_result_from_bytes(job.ranks.receive(rank_of_tile[t], kTag + static_cast<int>(t)));
  for (int r = 1; r < job.ranks.size(); ++r) {
    const std::string text = job.ranks.receive(r, kTag - 1);
    const Bytes bytes(text.begin(), text.end());
    ByteReader reader(bytes);
    const auto frames = read_matrices<BlockResult::Matrix6>(reader);
    for (std::size_t f = 0; f < frames.size(); ++f)
      if (!frames[f].isZero(0)) outcome.frame_covariance[FrameIndex(static_cast<std::int64_t>(f))] = frames[f];
    for (Eigen::MatrixXd& covariance : outcome.camera_covariance)
      if (Eigen::MatrixXd camera = read_matrix(reader); !camera.isZero(0)) covariance = std::move(camera);
  }
  return parts;
}

MergeOutcome make_outcome(const Adjusted& adjusted, const Block& block) {
  MergeOutcome outcome;
  outcome.state = adjusted.state;
  const SubtreeSums& sums = adjusted.posterior.sums;
  outcome.chi2 = sums.weighted_squares;
  outcome.degrees_of_freedom =
      sums.residuals - sums.unknowns + static_cast<std::int64_t>(sums.held.size()) + sums.held_points;
  outcome.image_sigma_px = adjusted.image_sigma_px;
  outcome.global_iterations = adjusted.position.global.accepted;
  outcome.newton_decrement = std::sqrt(sums.decrement_squared);
  const BlockGauge& gauge = adjusted.posterior.gauge;
  outcome.gauge = judge_gauge(sums, gauge, names_of(block)).text;
  for (const BlockComponent& part : gauge.components)
    if (part.defect > 0) {
      outcome.free_parts.push_back({FrameIndex(part.lowest_frame), static_cast<std::int32_t>(part.defect)});
      outcome.degrees_of_freedom += part.defect;  // what only the datum fixes takes nothing of the observations
    }
  outcome.seams = seam_checks(adjusted.posterior);
  outcome.observations = adjusted.posterior.observations;
  for (std::size_t k = 0; k < kObservationKinds; ++k)
    outcome.observations.kinds[k].scale = adjusted.position.scales.of[k];
  return outcome;
}

double seconds_since_1970() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

// Of all stages, this one as far as `event`, which ends it, says.
std::vector<StageStatistics> statistics_of(const Job& job, UnitEvent event) {
  std::vector<UnitEvent> events = read_events(job.store);
  event.time_s = seconds_since_1970();
  events.push_back(event);
  std::vector<StageStatistics> statistics;
  for (const StageRecord& record : job.records) statistics.push_back(stage_statistics(record, events));
  return statistics;
}

void write_final(Job& job, const MergeInputs& inputs, std::uint64_t fingerprint, const Adjusted& adjusted,
                 const MergeOutcome& outcome, const std::vector<TileResult>& parts, const UnitEvent& event) {
  if (!adjusted.converged)
    job.notes.push_back("the global adjustment did not converge: " + describe(adjusted.position.global));
  for (const SeamCheck& seam : outcome.seams)
    if (!seam.note.empty()) job.notes.push_back(seam.note);
  for (const std::string& line : describe_disagreements(adjusted.posterior.tile_checks, names_of(job.block)))
    job.notes.push_back(line);
  BlockResult result = assemble_result(job, inputs.tiles, outcome, parts);
  result.stages = statistics_of(job, event);
  std::filesystem::create_directories(job.store.path("result"));
  job.store.write(kResult, fingerprint, [&](const std::string& path) { write_result(path, result); });
  job.store.write_text("result/report.html", report_html(result, {job.options.directory, seconds_since_1970()}));
}

}  // namespace

void run_merge(Job& job, const BlockState& oriented, const Tiles& tiles, const std::vector<std::string>& tracks,
               const std::vector<std::string>& adjusted_units) {
  const double start = monotonic_seconds();
  reset_peak_rss();
  const MergeInputs inputs{oriented, tiles, tracks, adjusted_units};
  const std::uint64_t fingerprint = inputs_fingerprint(job, inputs);
  begin_stage(job, "merge", {{kResult, fingerprint, 0, nullptr}});
  const std::string current = on_first_rank(job.ranks, [&]() -> std::string {
    if (!job.store.up_to_date(kResult, fingerprint)) return "";
    try {
      job.store.verify(kResult);
    } catch (const StoreError&) {
      return "";
    }
    return std::filesystem::exists(job.store.path("result/report.html")) ? "current" : "";
  });
  if (!current.empty()) return;

  MergeCheckpoint checkpoint(job, fingerprint);
  clear_scratch(job);
  Adjusted adjusted = adjust_block(job, inputs, checkpoint);
  clear_scratch(job);
  MergeOutcome outcome = make_outcome(adjusted, job.block);
  const std::vector<TileResult> parts = gather_parts(job, inputs, adjusted, outcome);
  UnitEvent event;
  event.stage = "merge";
  event.unit = kResult;
  for (const std::string& text : job.ranks.gather_all(std::to_string(peak_rss_mib())))
    event.peak_rss_mib = std::max(event.peak_rss_mib, std::stod(text));
  event.seconds = monotonic_seconds() - start;
  on_first_rank(job.ranks, [&] {
    write_final(job, inputs, fingerprint, adjusted, outcome, parts, event);
    event.bytes = static_cast<std::int64_t>(job.store.seal(kResult)->length);
    job.events.append(event);
    checkpoint.clear();
    return std::string();
  });
}

}  // namespace megablock
