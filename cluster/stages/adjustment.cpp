#include <algorithm>
#include <limits>

#include "adjust/tile_adjustment.h"
#include "cluster/collective.h"
#include "cluster/stages/problem_hash.h"
#include "cluster/stages/stages.h"
#include "io/error.h"
#include "io/hash.h"
#include "io/unit_files.h"

namespace megablock {

namespace {

struct TileStart {
  TileProblem problem;
  TileState state;
};

TileStart make_start(const Job& job, const BlockState& oriented, const Tiles& tiles, TileIndex tile,
                     const std::string& tracks_unit) {
  const TrackSet tracks = read_tracks(job.store.verified_path(tracks_unit));
  TileStart start;
  start.problem = make_tile_problem(job.block, oriented, tiles, tile, tracks, job.settings.adjustment.observations);
  const Eigen::Vector3d unknown = Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  start.state =
      make_tile_state(start.problem, oriented, std::vector<Eigen::Vector3d>(start.problem.points.size(), unknown));
  return start;
}

TileAdjustment adjust_one(TileStart start, const AdjustOptions& options) {
  TileProblem& problem = start.problem;
  TileState& state = start.state;
  const AdjustSummary summary = adjust_tile(problem, state, options);

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
  result.points = std::move(state.points);
  result.kept = std::move(problem.kept);
  result.image_sigma_px = problem.image_sigma_px;
  result.summary = summary.text;
  return result;
}

}  // namespace

std::vector<std::string> run_adjustment(Job& job, const BlockState& oriented, const Tiles& tiles,
                                        const std::vector<std::string>& tracks) {
  std::vector<Unit> units;
  std::vector<std::string> names;
  for (std::size_t t = 0; t < tracks.size(); ++t) {
    const TileIndex tile(static_cast<std::int64_t>(t));
    const TileStart start = make_start(job, oriented, tiles, tile, tracks[t]);
    Hasher hasher;
    hasher.add(algorithm::kAdjustment);
    add_to_hash(hasher, job.settings.adjustment);
    add_to_hash(hasher, start.problem, start.state);
    Unit unit;
    unit.name = unit_name("adjust", tile.value);
    unit.fingerprint = hasher.value();
    unit.cost = static_cast<double>(start.problem.observation_count());
    unit.write = [&job, &oriented, &tiles, tile, track = tracks[t]](const std::string& path) {
      write_adjustment(path, adjust_one(make_start(job, oriented, tiles, tile, track), job.settings.adjustment));
    };
    names.push_back(unit.name);
    units.push_back(std::move(unit));
  }
  const StageOutcome outcome = run_stage(job, "adjustment", units);
  for (const FailedUnit& failure : outcome.failures) std::erase(names, failure.unit);
  if (names.empty()) throw AgreedError<ComputeError>("no tile could be adjusted: " + outcome.failures.front().reason);
  for (std::size_t t = 0; t < tracks.size(); ++t) {
    const std::string name = unit_name("adjust", static_cast<std::int64_t>(t));
    if (std::find(names.begin(), names.end(), name) == names.end())
      names.insert(names.begin() + static_cast<long>(t), "");
  }
  return names;
}

}  // namespace megablock
