#include "cluster/stages/merge/merge_tiles.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>

#include "adjust/terms/build_problem.h"
#include "adjust/tile/image_sigma.h"
#include "cluster/job/messages.h"
#include "cluster/job/stage.h"
#include "cluster/mpi/matrix_bytes.h"
#include "cluster/stages/merge/merge_start.h"

namespace megablock {

void load_own_tiles(const Job& job, const MergeInputs& inputs, const MergeStart& start,
                    const std::vector<int>& rank_of_tile, const std::function<void(RankTile&)>& prepare,
                    TileStore& own) {
  const RowsOfTiles rows = rows_of_tiles(job.block, start.state, inputs.tiles);
  job.tables.release();
  for (std::size_t t = 0; t < rank_of_tile.size(); ++t) {
    if (rank_of_tile[t] != job.ranks.rank()) continue;
    MergeTile loaded =
        load_merge_tile(job, inputs.oriented, start, inputs.tiles, TileIndex(static_cast<std::int64_t>(t)), rows[t],
                        inputs.tracks[t], inputs.adjusted[t]);
    RankTile tile{static_cast<std::int64_t>(t), std::move(loaded.problem), std::move(loaded.state)};
    prepare(tile);
    own.add(std::move(tile));
    job.tables.release();
  }
}

BlockState gather_state(const Job& job, const BlockState& start, const TileStore& tiles,
                        const MergeTreeRunner& runner) {
  ByteWriter writer;
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    const RankTile& tile = tiles.outline(i);
    // Unknowns that no kept residual of the tile touches have not moved with the block.
    const UnknownList& touched = runner.unknowns(i);
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
  BlockState state = start;
  std::fill(state.oriented.begin(), state.oriented.end(), std::uint8_t{0});
  for (const Bytes& bytes : job.ranks.gather_all(writer.take())) {
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

void follow(const BlockState& state, TileStore& tiles) {
  for (std::size_t row = 0; row < tiles.size(); ++row)
    tiles.change(
        row, [&](RankTile& tile) { tile.state = make_tile_state(tile.problem, state, std::move(tile.state.points)); });
}

void set_losses(const Job& job, const MergePosition& position, TileStore& tiles) {
  const ObservationOptions& options = job.settings.adjustment.observations;
  for (std::size_t row = 0; row < tiles.size(); ++row)
    tiles.change_outline(row, [&](RankTile& tile) {
      if (position.near)
        set_last_losses(tile.problem, options);
      else if (position.gross_errors == MergePosition::kSought)
        set_no_losses(tile.problem);
      else
        set_losses_from_afar(tile.problem, options);
    });
}

namespace {

void multiply_sigmas(const SigmaScales& change, TileStore& tiles, SigmaScales& scales) {
  scales.multiply(change);
  for (std::size_t row = 0; row < tiles.size(); ++row)
    tiles.change(row, [&](RankTile& tile) { scale_sigmas(tile.problem, change); });
}

std::array<LengthCounts*, 4> kinds_of(PriorLengths& lengths) {
  return {&lengths.position_horizontal, &lengths.position_height, &lengths.control_horizontal, &lengths.control_height};
}

}  // namespace

PriorLengths prior_lengths(const Job& job, TileStore& tiles) {
  PriorLengths lengths;
  for (std::size_t row = 0; row < tiles.size(); ++row) {
    const RankTile& tile = tiles.whole(row);
    lengths.add(prior_lengths(tile.problem, tile.state));
  }
  ByteWriter writer;
  for (const LengthCounts* counts : kinds_of(lengths)) writer.value(*counts);
  writer.values(lengths.groups);
  PriorLengths all;
  for (const Bytes& bytes : job.ranks.gather_all(writer.take())) {
    ByteReader reader(bytes);
    PriorLengths some;
    for (LengthCounts* counts : kinds_of(some)) *counts = reader.value<LengthCounts>();
    some.groups = reader.values<PriorLengths::OfGroup>();
    all.add(some);
  }
  return all;
}

bool control_seems_wrong(const PriorLengths& lengths) {
  constexpr double kChance = 0.1;  // that one of n right points is so far off
  const auto any = [&](const LengthCounts& counts) {
    const auto n = static_cast<double>(std::max<std::int64_t>(1, counts.total()));
    return counts.any_above(std::sqrt(2 * std::log(n / kChance)));  // P(|r| > x) = exp(-x^2 / 2) for two numbers
  };
  return any(lengths.control_horizontal) || any(lengths.control_height);
}

bool adopt_contradicted_scales(const Job& job, PriorLengths lengths, TileStore& tiles, SigmaScales& scales) {
  constexpr double kSettled = 1.2;  // a smaller change needs no further adjustment: a median of few is no better
  // Those have factors from variance components.
  if (job.settings.merge.estimate_sigmas) {
    lengths.position_horizontal = lengths.position_height = {};
    lengths.groups.clear();
  }
  const SigmaScales change = contradicted_sigma_scales(scales, lengths);
  if (!change.differ_by(kSettled)) return false;
  multiply_sigmas(change, tiles, scales);
  return true;
}

bool adopt_sigma_scales(MergeTreeRunner& runner, TileStore& tiles, SigmaScales& scales) {
  const SigmaScales change = next_sigma_scales(scales, runner.posterior().observations);
  if (!change.matter()) return false;
  multiply_sigmas(change, tiles, scales);
  return true;
}

PriorTests prior_tests(const RankTile& tile, const TileCovariance& covariance) {
  return test_priors(tile.problem, tile.state, {covariance.positions, covariance.positions_aside, covariance.points});
}

PriorTests prior_tests(MergeTreeRunner& runner) {
  PriorTests tests;
  const auto posterior = runner.posterior(
      [&](const RankTile& tile, const TileCovariance& covariance) { tests.add(prior_tests(tile, covariance)); });
  return posterior.gauge.free() ? PriorTests() : tests;
}

namespace {

PriorTests gather_tests(const Job& job, const PriorTests& tests) {
  ByteWriter writer;
  writer.value(tests.positions);
  writer.value(tests.control);
  writer.values(tests.far_off);
  writer.values(tests.aside);
  PriorTests all;
  for (const Bytes& bytes : job.ranks.gather_all(writer.take())) {
    ByteReader reader(bytes);
    PriorTests some;
    some.positions = reader.value<LengthCounts>();
    some.control = reader.value<LengthCounts>();
    some.far_off = reader.values<PriorTest>();
    some.aside = reader.values<PriorTest>();
    all.add(some);
  }
  return all;
}

// Whether observations with this loss may be ignored; others shall pull from any distance.
bool forgets(const RobustLoss& loss) { return loss.from_afar().kind != loss.kind; }

}  // namespace

bool judge_priors(const Job& job, const PriorTests& tests, TileStore& tiles, MergePosition& position) {
  using enum ObservationKind;
  const auto scaled = [&](ObservationKind horizontal, ObservationKind height) {
    return position.scales[horizontal] != 1 || position.scales[height] != 1;
  };
  const bool group_scaled = std::ranges::any_of(position.scales.of_groups(), [](const PositionScale& scale) {
    return scale.horizontal != 1 || scale.height != 1;
  });
  const bool afar = position.near == 0;
  const ObservationOptions& options = job.settings.adjustment.observations;
  PriorTests all = gather_tests(job, tests);
  std::erase_if(all.far_off, [&](const PriorTest& test) {
    return !forgets(test.prior.is_control ? options.control_loss : options.position_loss);
  });
  PriorVerdicts change = change_verdicts(
      all, position.verdicts.get(),
      {group_scaled || scaled(kPositionHorizontal, kPositionHeight), scaled(kControlHorizontal, kControlHeight)});
  if (!afar && !change.aside.empty()) {
    if (position.gross_errors == MergePosition::kNoneFound) return false;
    position.gross_errors = MergePosition::kSought;
    return true;
  }
  change = position.verdicts.store(change);
  const bool changed = !change.aside.empty() || !change.cleared.empty();
  position.gross_errors = changed || !afar ? MergePosition::kNotSought : MergePosition::kNoneFound;
  if (!changed) return false;
  for (std::size_t row = 0; row < tiles.size(); ++row)
    tiles.change(row, [&](RankTile& tile) {
      set_aside(change.aside, tile.problem);
      take_back(change.cleared, tile.problem);
    });
  return true;
}

std::int64_t screen(const Job& job, TileStore& tiles) {
  std::int64_t changed = 0;
  for (std::size_t row = 0; row < tiles.size(); ++row)
    tiles.change(row, [&](RankTile& tile) {
      const TileProblem& problem = tile.problem;
      // A tile whose own adjustment failed keeps no observations, and has no residuals for a judgement.
      bool any = false;
      for (std::int64_t p = 0; p < problem.point_count() && !any; ++p) any = problem.active(p);
      if (!any) return;
      changed += screen_observations(tile.problem, tile.state,
                                     screening_threshold(tile.problem, tile.state, job.settings.adjustment),
                                     job.settings.adjustment);
    });
  std::int64_t total = 0;
  for (const std::string& text : job.ranks.gather_all(std::to_string(changed))) total += std::stoll(text);
  return total;
}

std::string scratch_folder_of_rank(const Job& job) { return "rank-" + std::to_string(job.ranks.rank()); }

MemoryOptions memory_of_rank(const Job& job) {
  const auto bytes = [](double mib) { return static_cast<std::int64_t>(std::min(mib, kMostMib) * 1024 * 1024); };
  MemoryOptions memory;
  memory.factor_bytes = bytes(job.options.memory_mib);
  memory.tile_bytes = memory.factor_bytes / 2;
  memory.scratch = std::make_shared<ScratchSpace>(
      job.store.path("scratch/" + scratch_folder_of_rank(job)),
      job.options.scratch_mib >= 0 ? bytes(job.options.scratch_mib) : std::numeric_limits<std::int64_t>::max());
  return memory;
}

MemoryOptions memory_of_factors(MemoryOptions memory, const TileStore& tiles) {
  memory.factor_bytes = std::max<std::int64_t>(0, memory.factor_bytes - tiles.kept_bytes());
  return memory;
}

std::map<std::string, double> MergeCosts::figures() const {
  const auto mib = [](std::int64_t bytes) { return static_cast<double>(bytes) / (1 << 20); };
  return {{"tile_seconds", tile_seconds},
          {"front_seconds", front_seconds},
          {"pass_seconds", seconds},
          {"passes", static_cast<double>(passes)},
          {"tiles_in_scratch", static_cast<double>(tiles_in_scratch)},
          {"factors_in_scratch", static_cast<double>(factors.spilled)},
          {"subtrees_computed_again", static_cast<double>(factors.recomputed)},
          {"peak_factor_mib", mib(factors.peak_bytes)},
          {"peak_front_mib", mib(peak_front_bytes)},
          {"root_unknowns", static_cast<double>(fronts.root)},
          {"widest_front", static_cast<double>(fronts.widest)},
          {"front_operations", fronts.operations}};
}

MergeCosts gather_costs(const Job& job, const TileStore& tiles, const MergeTreeRunner& runner) {
  ByteWriter writer;
  writer.value(runner.memory());
  writer.value(runner.seconds());
  writer.value(runner.peak_front_bytes());
  writer.value(static_cast<std::int64_t>(tiles.size()));
  writer.value(tiles.spilled());
  MergeCosts all;
  for (const Bytes& bytes : job.ranks.gather_all(writer.take())) {
    ByteReader reader(bytes);
    const auto factors = reader.value<MemoryStatistics>();
    const auto seconds = reader.value<SweepSeconds>();
    all.peak_front_bytes = std::max(all.peak_front_bytes, reader.value<std::int64_t>());
    all.tiles += reader.value<std::int64_t>();
    all.tiles_in_scratch += reader.value<std::int64_t>();
    all.factors.put += factors.put;
    all.factors.spilled += factors.spilled;
    all.factors.recomputed += factors.recomputed;
    all.factors.peak_bytes = std::max(all.factors.peak_bytes, factors.peak_bytes);
    all.tile_seconds += seconds.tiles;
    all.front_seconds += seconds.fronts;
    all.seconds = std::max(all.seconds, seconds.all);
    all.passes = std::max(all.passes, seconds.sweeps_up);
  }
  all.fronts = front_costs(runner.plan());
  return all;
}

void say_costs(const Job& job, const MergeCosts& costs) {
  if (!job.is_first_rank()) return;
  say(job, kMergeStage,
      fmt::format("fronts above the tiles: widest {} unknowns, at the root {}, {:.3g} operations", costs.fronts.widest,
                  costs.fronts.root, costs.fronts.operations));
  say(job, kMergeStage,
      fmt::format(
          "last round: {:.1f} s, of them {:.1f} s on tiles and {:.1f} s on fronts above them (mean of the ranks)",
          costs.seconds, costs.tile_seconds / job.ranks.size(), costs.front_seconds / job.ranks.size()));
  say(job, kMergeStage,
      fmt::format("{} of {} tiles in scratch; factors: {} made, {} spilled to scratch, {} subtrees computed again, at "
                  "most {:.1f} MiB on a rank",
                  costs.tiles_in_scratch, costs.tiles, costs.factors.put, costs.factors.spilled,
                  costs.factors.recomputed, static_cast<double>(costs.factors.peak_bytes) / (1 << 20)));
}

}  // namespace megablock
