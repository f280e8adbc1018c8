#include "cluster/stages/merge/merge.h"

// Runs the merge: the exact block-wise adjustment of all tiles over all ranks, then the result.

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "adjust/tile/image_sigma.h"
#include "cluster/job/messages.h"
#include "cluster/job/stage.h"
#include "cluster/job/work_queue.h"
#include "cluster/mpi/collective.h"
#include "cluster/outcome/diagnostics.h"
#include "cluster/process/process_memory.h"
#include "cluster/process/progress.h"
#include "cluster/process/signals.h"
#include "cluster/stages/common/block_tables.h"
#include "cluster/stages/merge/assemble_result.h"
#include "cluster/stages/merge/block_image_sigma.h"
#include "cluster/stages/merge/merge_checkpoint.h"
#include "cluster/stages/merge/merge_start.h"
#include "cluster/stages/result/provenance.h"
#include "cluster/stages/result/result_files.h"
#include "io/base/error.h"
#include "io/base/hash.h"
#include "io/evaluation/receivers.h"
#include "io/store/job/events.h"
#include "io/text/counted.h"
#include "merge/checks/seam_text.h"
#include "merge/tile/cluster_scores.h"
#include "merge/tree/merge_tree_runner.h"

namespace megablock {

namespace {

std::uint64_t inputs_fingerprint(const Stage& stage, const Job& job, const MergeInputs& inputs) {
  Hasher hasher;
  hasher.add(stage.algorithm);
  add_to_hash(hasher, job.settings.merge);
  add_to_hash(hasher, job.settings.adjustment);
  if (job.settings.environment.any()) add_to_hash(hasher, job.settings.environment);
  hasher.add(job.store.seal("block.h5")->content_hash).add(job.store.seal("tiles.h5")->content_hash);
  for (const std::string& name : inputs.tracks) hasher.add(job.store.seal(name)->content_hash);
  for (const std::string& name : inputs.adjusted)
    hasher.add(name.empty() ? std::uint64_t{0} : job.store.seal(name)->content_hash);
  return hasher.value();
}

std::vector<std::int64_t> observation_counts(const Job& job, const MergeInputs& inputs) {
  std::vector<std::int64_t> counts;
  for (const std::string& name : inputs.tracks)
    counts.push_back(static_cast<std::int64_t>(job.store.seal(name)->length));
  return counts;
}

// A block that does not converge with losses that pull from any distance has not come near its solution, and losses
// that ignore what is far off would hold it where it is. Most often outliers keep it away; a screening
// removes those, and the block begins from afar once more.
constexpr int kMostRoundsAfar = 3;

// Estimated and scaled sigmas change the weights, so that they need rounds of their own to settle. Rounds from afar
// beyond the first do not count.
int most_rounds(const MergeSettings& settings, const MergePosition& position) {
  constexpr int kSigmaRounds = 10, kScaleRounds = 1;
  const int before = static_cast<int>(position.first_round) + std::max(0, position.rounds_afar - 1);
  if (settings.estimate_sigmas) return before + std::max(settings.screening_rounds, kSigmaRounds);
  return before + settings.screening_rounds + (position.scales.matter() ? kScaleRounds : 0);
}

bool converged(const GlobalState& state) {
  return state.outcome == GlobalOutcome::kConverged || state.outcome == GlobalOutcome::kRoundingFloor;
}

// Clears the scratch folder of the job. The folder itself stays, because another disk may be mounted there. Folders of
// this run's ranks stay while the ranks `use` them.
void clear_scratch(const Job& job, bool use) {
  const std::vector<std::string> kept =  // ranks have removed their own files before they report
      job.ranks.gather_all(use ? scratch_folder_of_rank(job) : std::string());
  on_first_rank(job.ranks, [&] {
    const std::filesystem::path folder(job.store.path("scratch"));
    std::error_code ignored;
    for (const auto& entry : std::filesystem::directory_iterator(folder, ignored))
      if (std::ranges::find(kept, entry.path().filename().string()) == kept.end())
        std::filesystem::remove_all(entry.path(), ignored);
    std::filesystem::remove(folder, ignored);
    return std::string();
  });
}

// Only the last round iterates to the end. The rounds before it only lead to decisions on observations and to sigmas. A
// mean of a hundredth of a sigma of the frames' unknowns is enough for these: chi-square is then off by 1e-4 of their
// number. A tenth is enough for the first round, which only brings the block near its solution. A round between the
// first and the last starts near its end. Where one iteration does not get there, most positions or control points are
// often beyond the corners of their losses, and larger sigmas are what they need.
GlobalOptions options_of(const MergeSettings& settings, std::size_t frames, const MergePosition& position, bool last) {
  constexpr double kSettled = 0.01, kNearby = 0.1;
  constexpr int kMostBetween = 1;
  const bool near = position.near != 0, sought = position.gross_errors == MergePosition::kSought;
  const double settled = (near || sought ? kSettled : kNearby) * std::sqrt(6 * static_cast<double>(frames));
  GlobalOptions options;
  options.max_decrement = last ? settings.decrement : std::max(settings.decrement, settled);
  options.confirm = last;
  options.max_iterations = near && !last ? std::min(kMostBetween, settings.max_iterations) : settings.max_iterations;
  return options;
}

// The iterations before the last screening end by a looser limit of their own. The line then names that limit, because
// "converged" alone would mean the limit of the options.
void say_iteration(const Job& job, const GlobalState& state, const GlobalOptions& options) {
  if (!job.is_first_rank()) return;
  std::string line = describe(state);
  if (state.outcome == GlobalOutcome::kConverged && options.max_decrement > job.settings.merge.decrement)
    line += fmt::format(" (limit {:.1e} before the last screening)", options.max_decrement);
  say(job, kMergeStage, line);
}

// Loads this rank's tiles from their own adjustments, or from the checkpoint that was found. Control points that the
// tiles set aside are set aside in `position`, the beginning. Returns the state of the block.
BlockState load_block(const Job& job, MergeInputs& inputs, const MergeCheckpoint& checkpoint,
                      const std::optional<MergePosition>& found, const std::vector<int>& rank_of_tile,
                      MergePosition& position, TileStore& tiles) {
  MergeStart start =
      found ? MergeStart{checkpoint.state(), {}, {}, {}} : merge_start(job, inputs.oriented, inputs.adjusted);
  position.verdicts.store({start.aside, {}});
  start.paths = paths_for_rolling_shutters(job.block);
  const double start_sigma = found ? 0 : start_image_sigma(job, inputs.adjusted);
  load_own_tiles(
      job, inputs, start, rank_of_tile,
      [&](RankTile& tile) {
        if (found) {
          checkpoint.load_tile(tile);
          scale_sigmas(tile.problem, found->scales);
        } else {
          set_image_sigma(tile.problem, start_sigma);
        }
        set_aside(position.verdicts.get().aside, tile.problem);
      },
      tiles);
  return std::move(start.state);
}

// Begins the next adjustment of the block, in the round that `position` gives.
void begin_adjustment(MergePosition& position, const GlobalOptions& options) {
  position.tried_steps += position.global.iterations;
  position.global = start_again(position.global, options);
}

// Whether positions and control points are tested before the last round: where gross errors are sought; where a block
// with sigmas that were `scaled` in this round does not converge, from which a gross error may keep it for long; and
// where the sigmas have settled with a control point far off, because the iterations to the end would be for nothing.
// The tests cost as much as two iterations.
bool asks_for_tests(const MergePosition& position, bool converged, bool scaled, bool rescaled,
                    const PriorLengths& lengths) {
  if (position.near == 0) return position.gross_errors == MergePosition::kSought;
  if (position.gross_errors != MergePosition::kNotSought) return false;
  return (!converged && scaled) || (!rescaled && control_seems_wrong(lengths));
}

// Whether the sigmas are asked after the last adjustment: a block in which nothing changed after the one from afar
// comes to it at once. Their factors give it further rounds.
bool asks_for_scales(const MergeSettings& settings, const MergePosition& position) {
  return settings.scale_contradicted_sigmas && position.rounds_afar > 0 && !position.scales.matter();
}

bool has_control(const Block& block) {
  return std::ranges::any_of(block.control_points,
                             [](const ControlPoint& point) { return point.role == PointRole::kControl; });
}

// Begins from afar again, because a gross error bends the block, until good observations seem wrong.
void begin_again(MergePosition& position, const GlobalOptions& options) {
  position.first_round = ++position.round;
  position.rounds_afar = 0;
  position.near = 0;
  begin_adjustment(position, options);
}

Adjusted adjust_block(const Job& job, MergeInputs& inputs, MergeCheckpoint& checkpoint) {
  const std::size_t frames = job.block.frames.size();
  const std::vector<MotionReference> references = motion_references(job.block, inputs.tiles);
  job.tables.release();  // frames
  const std::vector<int> rank_of_tile =
      distribute_tiles(inputs.tiles.tree, observation_counts(job, inputs), job.ranks.size());
  const std::optional<MergePosition> found = checkpoint.find();
  MergePosition start =
      found ? *found
            : MergePosition{0, 0, start_global(options_of(job.settings.merge, frames, {}, false)), {}, 0, 0, 0, 0, {}};
  const MemoryOptions memory = memory_of_rank(job);
  SweepRecorder recorder(memory.scratch, job.options.record_s, stop_requested);
  const std::optional<MergePosition> within = checkpoint.find_sweep(start, recorder);
  clear_scratch(job, true);  // a killed run may have had more ranks
  TileStore tiles(memory);
  Adjusted adjusted;
  BlockState& block = adjusted.state;
  block = load_block(job, inputs, checkpoint, found, rank_of_tile, start, tiles);
  inputs.oriented = {};
  job.tables.release();

  MergePosition& position = adjusted.position;
  position = within ? *within : start;
  recorder.set_position([&] { return checkpoint.of_sweep(position); });
  std::int32_t saved = position.global.accepted;
  for (;;) {
    const bool last =
        position.gross_errors != MergePosition::kSought && position.round >= most_rounds(job.settings.merge, position);
    if (last) position.near = 1;
    const bool near = position.near != 0;
    const GlobalOptions options = options_of(job.settings.merge, frames, position, last);
    set_losses(job, position, tiles);
    MergeTreeRunner runner(job.ranks, inputs.tiles.tree, rank_of_tile, tiles, memory_of_factors(memory, tiles));
    runner.record_sweeps(recorder);
    return_freed_memory();  // memory from which the plans were made
    if (last) runner.expect_posterior();
    if (last && job.settings.merge.empirical_sigmas)
      runner.expect_scores(spread_share(std::ssize(job.block.images), std::ssize(job.block.cameras)));
    adjust_globally(runner, options, position.global, [&](const GlobalState& state) {
      return_freed_memory();
      say_iteration(job, state, options);
      if (state.accepted != saved) {
        saved = state.accepted;
        position.global = state;
        checkpoint.write(position, tiles, gather_state(job, block, tiles, runner));
      }
      if (job.ranks.any(stop_requested()))
        throw AgreedError<Interrupted>("stopped in stage 'merge' as asked; run the same command to resume");
    });
    adjusted.converged = converged(position.global);
    block = gather_state(job, block, tiles, runner);
    follow(block, tiles);
    if (last) {
      if (asks_for_scales(job.settings.merge, position) &&
          adopt_contradicted_scales(job, prior_lengths(job, tiles), tiles, position.scales)) {
        position.first_round = ++position.round;
        begin_adjustment(position, options);
        checkpoint.write(position, tiles, block);
        continue;
      }
      find_posterior(job, inputs, references, runner, adjusted);
      if (judge_priors(job, adjusted.prior_tests, tiles, position)) {
        begin_again(position, options);
        checkpoint.write(position, tiles, block);
        continue;
      }
      if (job.settings.merge.empirical_sigmas) find_empirical(job, runner, adjusted);
      adjusted.costs = gather_costs(job, tiles, runner);
      say_costs(job, adjusted.costs);
      break;
    }
    const bool scaled = position.scales.matter();
    const PriorLengths lengths = near ? prior_lengths(job, tiles) : PriorLengths();
    const bool rescaled = near && job.settings.merge.scale_contradicted_sigmas &&
                          adopt_contradicted_scales(job, lengths, tiles, position.scales);
    if (asks_for_tests(position, adjusted.converged, scaled, rescaled, lengths) &&
        judge_priors(job, prior_tests(runner), tiles, position)) {
      begin_again(position, options);
      checkpoint.write(position, tiles, block);
      continue;
    }
    bool changed = adopt_image_sigma(job, tiles, rank_of_tile.size(), block) || rescaled;
    if (job.settings.merge.estimate_sigmas) changed = adopt_sigma_scales(runner, tiles, position.scales) || changed;
    changed = screen(job, tiles) > 0 || changed;
    if (!near) {
      ++position.rounds_afar;
      position.near = adjusted.converged || position.rounds_afar == kMostRoundsAfar;
      changed = changed || has_control(job.block);  // which is tested before the last round
    }
    position.round = changed ? position.round + 1 : most_rounds(job.settings.merge, position);
    begin_adjustment(position, options);
    checkpoint.write(position, tiles, block);
  }
  adjusted.image_sigma_px = common_image_sigma(job, tiles);
  return adjusted;
}

// Collective. The largest of the figures of all ranks.
double largest(const Job& job, double figure) {
  for (const std::string& text : job.ranks.gather_all(std::to_string(figure)))
    figure = std::max(figure, std::stod(text));
  return figure;
}

std::string without_optimum(const GlobalState& state, double limit) {
  const std::string after = "the adjustment did not converge: after " + counted(state.iterations, "iteration");
  const double decrement = std::sqrt(state.decrement_squared);
  if (state.outcome == GlobalOutcome::kFailed)
    return fmt::format(
        "{} no step decreases the cost, although the next one would be {:.1e} sigmas long; check start "
        "poses and cameras, and whether many observations are wrong",
        after, decrement);
  return fmt::format(
      "{} the next one would still be {:.1e} sigmas long ({:.1e} is asked); raise "
      "'merge.max_iterations', or determine the block better by heights, attitudes or control points",
      after, decrement, limit);
}

// Why an existing result counts as a failed unit, in this run and in later ones that find it; empty: it does not.
std::string shortfall(const Adjusted& adjusted, const std::vector<TilePart>& parts, const MergeSettings& settings) {
  if (!adjusted.converged) return without_optimum(adjusted.position.global, settings.decrement);
  if (std::ranges::none_of(adjusted.state.oriented, [](std::uint8_t oriented) { return oriented != 0; }))
    return "no image is oriented: too few observations hold in the adjustment; check start poses and cameras, and "
           "the limits for tie points under 'adjustment' in the project file";
  const auto sum = [&](std::int64_t TilePart::*number) {
    std::int64_t all = 0;
    for (const TilePart& part : parts) all += part.*number;
    return all;
  };
  if (sum(&TilePart::measured) > 0 && sum(&TilePart::kept) == 0)
    return "no tie point observation holds in the adjustment, so that the poses are those of positions and attitudes "
           "alone; check start poses, cameras and matches";
  return "";
}

void add_shortfall(const Job& job, JobRecord& record, const std::string& reason) {
  if (!reason.empty()) add_failures(job, record, {{kMergeStage, kResult, reason}});
}

std::string shortfall_before(const Job& job) {
  return on_first_rank(job.ranks, [&] {
    const auto record = read_record(job.store, kMergeStage);
    return record && !record->failures.empty() ? record->failures.front().reason : std::string();
  });
}

// The statistics of all stages; this one's end with `event`.
std::vector<StageStatistics> statistics_of(const Job& job, const JobRecord& record, UnitEvent event) {
  std::vector<UnitEvent> events = read_events(job.store);
  event.time_s = seconds_since_1970();
  events.push_back(event);
  std::vector<StageStatistics> statistics;
  for (const StageRecord& stage : record.stages) statistics.push_back(stage_statistics(stage, events));
  return statistics;
}

void write_final(const Job& job, JobRecord& record, JobBlock& own, const MergeInputs& inputs,
                 const OrientationStage& oriented, std::uint64_t fingerprint, const Adjusted& adjusted,
                 const std::string& reason, MergeOutcome outcome, const std::vector<TilePart>& parts,
                 UnitEvent& event) {
  if (!reason.empty()) {
    record.notes.push_back(reason);
    warn(job, kMergeStage, reason);
  }
  const std::size_t notes_before = record.notes.size();
  for (const SeamCheck& seam : outcome.seams)
    if (!seam.note.empty()) add_note(job, record, kMergeStage, seam.note);
  for (const std::string& line : describe_disagreements(adjusted.posterior.tile_checks, names_of(job.block)))
    add_note(job, record, kMergeStage, line);
  event.figures["seam_alarms"] = static_cast<double>(record.notes.size() - notes_before);
  for (const std::string& line : judge_kept(parts)) add_note(job, record, kMergeStage, line);
  for (const std::string& line : judge_motions(job.block, inputs.tiles, parts)) {
    record.notes.push_back(line);
    say(job, kMergeStage, line);
  }
  job.tables.release();  // frames
  BlockResult result =
      assemble_result(job, record, own.block, inputs.tiles, oriented.not_oriented, std::move(outcome), parts);
  for (const ShiftFigures& shift : shifts_of(result)) {
    result.notes.push_back(shift_text(result, shift));
    add_note(job, record, kMergeStage, result.notes.back());
  }
  if (!reason.empty()) result.failures.push_back({kMergeStage, kResult, reason});
  result.stages = statistics_of(job, record, event);
  std::vector<PartTracks::File> files;
  for (const TilePart& part : parts) files.push_back({part_path(job, part.tile), part.track_count});
  write_result_files(job.store, own.tables, fingerprint, std::move(result), std::move(files), job.settings.diagnostics);
}

}  // namespace

void run_merge(const Stage& stage, const Job& job, JobRecord& record, JobBlock& own, OrientationStage oriented,
               const Tiles& tiles, const std::vector<std::string>& tracks,
               const std::vector<std::string>& adjusted_units) {
  const double start = monotonic_seconds();
  return_freed_memory();
  record.peak_memory.begin_stage();
  MergeInputs inputs{std::move(oriented.state), tiles, tracks, adjusted_units};
  const std::uint64_t fingerprint = inputs_fingerprint(stage, job, inputs);
  const std::string before = shortfall_before(job);
  begin_stage(job, record, stage, {{kResult, fingerprint, 0, nullptr}});
  const std::string current = on_first_rank(job.ranks, [&]() -> std::string {
    if (!is_current(job, kMergeStage, kResult, fingerprint)) return "";
    return std::filesystem::exists(job.store.path(kReportPage)) ? "current" : "";
  });
  if (!current.empty()) {  // a run that was killed after its result may have left checkpoints
    if (job.is_first_rank()) MergeCheckpoint(job, record.events, fingerprint).clear();
    return add_shortfall(job, record, before);
  }

  MergeCheckpoint checkpoint(job, record.events, fingerprint);
  Adjusted adjusted = adjust_block(job, inputs, checkpoint);
  return_freed_memory();  // memory of fronts and tiles
  clear_scratch(job, false);
  const std::vector<TilePart> parts = gather_parts(job, adjusted, tracks.size());
  const std::string reason = shortfall(adjusted, parts, job.settings.merge);
  UnitEvent event;
  event.stage = kMergeStage;
  event.unit = kResult;
  event.peak_rss_mib = largest(job, peak_rss_mib());
  event.figures = adjusted.costs.figures();
  event.figures["tried_steps"] = adjusted.position.tried_steps + adjusted.position.global.iterations;
  double process_peak_mib = largest(job, record.peak_memory.mib());
  event.seconds = monotonic_seconds() - start;
  on_first_rank(job.ranks, [&] {
    restore_names(job.store, own);
    write_final(job, record, own, inputs, oriented, fingerprint, adjusted, reason,
                make_outcome(job, adjusted, inputs.tiles), parts, event);
    // The result could not yet contain the peak memory of its own writing.
    event.peak_rss_mib = std::max(event.peak_rss_mib, peak_rss_mib());
    process_peak_mib = std::max(process_peak_mib, record.peak_memory.mib());
    event.figures["process_peak_rss_mib"] = process_peak_mib;
    event.seconds = monotonic_seconds() - start;
    event.bytes = static_cast<std::int64_t>(job.store.seal(kResult)->length);
    record.events.append(event);
    checkpoint.clear();
    return std::string();
  });
  add_shortfall(job, record, reason);
}

}  // namespace megablock
