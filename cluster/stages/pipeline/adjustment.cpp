#include "cluster/stages/pipeline/adjustment.h"

#include <algorithm>
#include <functional>
#include <limits>
#include <optional>
#include <utility>

#include "adjust/checks/control_check.h"
#include "adjust/problem/environment_correction.h"
#include "adjust/terms/build_problem.h"
#include "adjust/tile/image_sigma.h"
#include "adjust/tile/rolling_start.h"
#include "adjust/tile/tile_adjustment.h"
#include "adjust/tile/track_parts.h"
#include "cluster/job/work_queue.h"
#include "cluster/mpi/collective.h"
#include "cluster/stages/common/block_hash.h"
#include "cluster/stages/common/problem_hash.h"
#include "cluster/stages/common/units.h"
#include "io/base/error.h"
#include "io/base/hash.h"
#include "io/store/units/adjustment_file.h"
#include "io/store/units/tracks_file.h"
#include "merge/scratch/bytes.h"
#include "merge/tree/tile_solver.h"

namespace megablock {

namespace {

// The data from which tiles are made.
struct OrientedTiles {
  const BlockState& oriented;
  const Tiles& tiles;
  const RowsOfTiles rows;
  const std::optional<FramePaths> paths;  // of blocks with rolling shutters
};

// A tile before its adjustment.
struct TileStart {
  TrackSet tracks;
  TileProblem problem;
  TileState state;
};

TileStart measured_start(const Job& job, const OrientedTiles& from, TileIndex tile, TrackSet tracks) {
  TileStart start;
  start.tracks = std::move(tracks);
  start.problem =
      make_tile_problem(job.block, from.oriented, from.tiles, tile, start.tracks, job.settings.adjustment.observations,
                        from.rows.at(static_cast<std::size_t>(tile.value)));
  const Eigen::Vector3d unknown = Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  start.state =
      make_tile_state(start.problem, from.oriented, std::vector<Eigen::Vector3d>(start.problem.points.size(), unknown));
  return start;
}

// The frames, cameras and mounts of an adjusted tile.
void take_solution(const TileState& solved, TileState& state) {
  state.frames = solved.frames;
  state.cameras = solved.cameras;
  state.mounts = solved.mounts;
}

RollingShutters shutters_of(const Job& job, const OrientedTiles& from, const TileProblem& problem) {
  return {*from.paths, tile_readouts(job.block, problem), from.oriented};
}

// Corrects the measurements for rolling shutters and for the environment. The latter needs the heights of the ground;
// it takes those of the points intersected from measurements without it.
void correct_start(const Job& job, const OrientedTiles& from, TileStart& start) {
  TileState at = start.state;
  if (from.paths)
    correct_rolling_start(shutters_of(job, from, start.problem), job.settings.adjustment, start.problem, at);
  if (!job.settings.environment.any()) return;
  const std::vector<std::uint8_t> kept = start.problem.kept;
  triangulate_points(start.problem, at, job.settings.adjustment);
  start.problem.kept = kept;
  correct_measurements(job.settings.environment, job.block.ground, at, start.problem);
}

// `solved`: a solution of the tile from which corrections are taken, and in which the state begins; none: the
// orientation of the block.
TileStart make_start(const Job& job, const OrientedTiles& from, TileIndex tile, TrackSet tracks,
                     const TileState* solved = nullptr) {
  TileStart start = measured_start(job, from, tile, std::move(tracks));
  if (solved != nullptr) take_solution(*solved, start.state);
  if (from.paths || job.settings.environment.any()) correct_start(job, from, start);
  return start;
}

// An adjusted tile with its tracks split into parts. The merge intersects the parts that were put back. The adjusted
// tile is freed before the split one is made, because two of them would double the memory of the stage.
TileStart with_parts(const Job& job, const OrientedTiles& from, TileIndex tile, TileStart adjusted,
                     const TrackParts& parts) {
  const std::vector<std::int64_t> rows = rows_of_split(adjusted.tracks, parts);
  TrackSet tracks = split_tracks(adjusted.tracks, parts);
  const std::vector<std::uint8_t> kept = std::move(adjusted.problem.kept);
  const double image_sigma_px = adjusted.problem.image_sigma_px;
  TileState state = std::move(adjusted.state);
  adjusted = {};

  TileStart split = measured_start(job, from, tile, std::move(tracks));
  split.problem.kept = kept;  // rows of control points follow those of the tracks
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const auto row = static_cast<std::size_t>(rows[i]);
    split.problem.kept[i] = parts[row] > 0 || kept[row];
  }
  set_image_sigma(split.problem, image_sigma_px);
  const std::vector<Eigen::Vector3d> unknown = std::exchange(split.state.points, {}),
                                     whole_points = std::exchange(state.points, {});
  split.state = std::move(state);
  const std::vector<TilePoint>& points = split.problem.points;
  for (std::size_t p = 0, whole = 0; p < points.size(); ++p) {
    const bool further = p > 0 && points[p].role == PointRole::kTie && points[p - 1].role == PointRole::kTie &&
                         points[p].index == points[p - 1].index;
    split.state.points.push_back(further ? unknown[p] : whole_points[whole++]);
  }
  return split;
}

// What the images alone tell of a tile with control points.
struct CheckedControl {
  std::optional<TileState> start;  // the tile as the images alone give it, moved onto the control; none: not better
  std::vector<PriorId> wrong;      // control points that contradict it
};

CheckedControl check_tile_control(const Job& job, const OrientedTiles& from, const TileStart& start,
                                  const AdjustOptions& options) {
  const RobustLoss& loss = options.observations.control_loss;
  if (loss.from_afar().kind == loss.kind) return {};  // no observation may be ignored
  const std::vector<PriorId> control = testable_control(start.problem);
  if (std::ssize(control) < kFewestControl) return {};
  TileProblem problem = start.problem;
  TileState state = start.state;
  set_aside(control, problem);
  try {
    adjust_tile(problem, state, options, solve_by_condensation);
  } catch (const ComputeError&) {
    return {};  // the images alone do not hold the tile together
  }
  const auto check = check_control(job.block, from.oriented, problem, state);
  if (!check) return {};
  CheckedControl result{std::nullopt, check->wrong};
  if (!problem.positions.empty()) return result;
  for (Pose& pose : state.frames) pose = check->to_control(pose);
  result.start = std::move(state);
  return result;
}

TileAdjustment adjust_one(const Job& job, const OrientedTiles& from, TileIndex tile, const std::string& tracks_unit) {
  AdjustOptions options = job.settings.adjustment;
  options.only_start = true;
  TileStart adjusted = make_start(job, from, tile, read_tracks(job.store.verified_path(tracks_unit)));
  const CheckedControl control = check_tile_control(job, from, adjusted, options);
  const auto begin_in = [&](const TileState& solved) {
    adjusted = make_start(job, from, tile, std::move(adjusted.tracks), &solved);
  };
  const auto adjust = [&] {
    set_aside(control.wrong, adjusted.problem);
    return adjust_tile(adjusted.problem, adjusted.state, options, solve_by_condensation);
  };
  if (control.start) begin_in(*control.start);
  AdjustSummary summary = adjust();
  if (from.paths) {  // the poses tell the motion better than those of the orientation
    const TileState solved = std::move(adjusted.state);
    begin_in(solved);
    summary = adjust();
  }
  TrackParts parts = find_track_parts(adjusted.problem, adjusted.state,
                                      screening_threshold(adjusted.problem, adjusted.state, options), options);
  const auto restored = parts.size() - static_cast<std::size_t>(std::count(parts.begin(), parts.end(), 0));
  if (restored > 0) adjusted = with_parts(job, from, tile, std::move(adjusted), parts);
  TileProblem& problem = adjusted.problem;
  TileState& state = adjusted.state;

  TileAdjustment result;
  result.frames = problem.frames;
  result.poses = state.frames;
  result.cameras = problem.cameras;
  result.intrinsics = state.cameras;
  result.observations.assign(problem.frames.size(), 0);
  result.camera_observations.assign(problem.cameras.size(), 0);
  for (const MountId& id : problem.mounts) {
    result.mount_rigs.push_back(id.rig);
    result.mount_numbers.push_back(id.mount);
  }
  result.mounts = state.mounts;
  result.mount_observations.assign(problem.mounts.size(), 0);
  for (std::int64_t o = 0; o < problem.observation_count(); ++o) {
    if (!problem.kept[o]) continue;
    const TileImage& image = problem.images[static_cast<std::size_t>(problem.image[o].value)];
    ++result.observations[static_cast<std::size_t>(image.frame.value)];
    ++result.camera_observations[static_cast<std::size_t>(image.camera.value)];
    ++result.mount_observations[static_cast<std::size_t>(image.mount)];
  }
  const auto count = [&](std::int32_t mount) {
    if (mount >= 0) ++result.mount_observations[static_cast<std::size_t>(mount)];
  };
  for (const auto& term : problem.positions) count(term.receiver), count(term.group);
  for (const auto& term : problem.attitudes) count(term.receiver);
  result.parts = std::move(parts);
  result.points = std::move(state.points);
  result.kept = std::move(problem.kept);
  result.image_sigma_px = problem.image_sigma_px;
  for (const PriorId& wrong : control.wrong) result.control_aside.push_back(wrong.row);
  result.summary = summary.text + ", " + std::to_string(restored) + " of them put back as tracks of their own";
  return result;
}

void add_motions_to_hash(const Job& job, const OrientedTiles& from, const TileStart& start, Hasher& hasher) {
  for (const Readout& readout : tile_readouts(job.block, start.problem)) hasher.add(readout.time_s);
  for (const Motion& motion : tile_motions(*from.paths, start.problem, start.state, from.oriented)) {
    add_to_hash(hasher, motion.velocity);
    add_to_hash(hasher, motion.turn);
  }
}

struct TileMark {
  std::uint64_t fingerprint = 0;
  std::int64_t observations = 0;
};

// Collective. The marks of all tiles; every rank reads its share of the tiles.
std::vector<TileMark> tile_marks(const Stage& stage, const Job& job, const OrientedTiles& from,
                                 const std::vector<std::string>& tracks) {
  const auto ranks = static_cast<std::size_t>(job.ranks.size());
  ByteWriter writer;
  char kind = 'c';
  std::string error;
  try {
    for (auto t = static_cast<std::size_t>(job.ranks.rank()); t < tracks.size(); t += ranks) {
      const TileStart start = measured_start(job, from, TileIndex(static_cast<std::int64_t>(t)),
                                             read_tracks(job.store.verified_path(tracks[t])));
      Hasher hasher;
      hasher.add(stage.algorithm);
      add_to_hash(hasher, job.settings.adjustment);
      if (job.settings.environment.any()) add_to_hash(hasher, job.settings.environment);
      add_to_hash(hasher, start.problem, start.state);
      if (from.paths) add_motions_to_hash(job, from, start, hasher);
      writer.value(TileMark{hasher.value(), start.problem.observation_count()});
      job.tables.release();
    }
  } catch (const InputError& e) {
    kind = 'i';
    error = e.what();
  } catch (const std::exception& e) {
    error = e.what();
  }
  share_error(job.ranks, kind, error);
  std::vector<TileMark> marks(tracks.size());
  const std::vector<Bytes> all = job.ranks.gather_all(writer.take());
  for (std::size_t rank = 0; rank < ranks; ++rank) {
    ByteReader reader(all[rank]);
    for (std::size_t t = rank; t < tracks.size(); t += ranks) marks[t] = reader.value<TileMark>();
  }
  return marks;
}

}  // namespace

std::vector<std::string> run_adjustment(const Stage& stage, const Job& job, JobRecord& record,
                                        const BlockState& oriented, const Tiles& tiles,
                                        const std::vector<std::string>& tracks) {
  const OrientedTiles from{oriented, tiles, rows_of_tiles(job.block, oriented, tiles),
                           paths_for_rolling_shutters(job.block)};
  job.tables.release();
  const std::vector<TileMark> marks = tile_marks(stage, job, from, tracks);
  std::vector<Unit> units;
  std::vector<std::string> names;
  for (std::size_t t = 0; t < tracks.size(); ++t) {
    const TileIndex tile(static_cast<std::int64_t>(t));
    Unit unit;
    unit.name = unit_name(stage.folder(), tile.value);
    unit.fingerprint = marks[t].fingerprint;
    unit.cost = static_cast<double>(marks[t].observations);
    unit.write = [&job, &from, tile, track = tracks[t]](const std::string& path) {
      write_adjustment(path, adjust_one(job, from, tile, track));
    };
    names.push_back(unit.name);
    units.push_back(std::move(unit));
  }
  const StageOutcome outcome = run_stage(job, record, stage, units);
  for (const FailedUnit& failure : outcome.failures) std::erase(names, failure.unit);
  if (names.empty()) throw AgreedError<ComputeError>("no tile could be adjusted: " + outcome.failures.front().reason);
  for (std::size_t t = 0; t < tracks.size(); ++t) {
    const std::string name = unit_name(stage.folder(), static_cast<std::int64_t>(t));
    if (std::find(names.begin(), names.end(), name) == names.end())
      names.insert(names.begin() + static_cast<long>(t), "");
  }
  return names;
}

}  // namespace megablock
