#include <algorithm>
#include <limits>

#include "adjust/tile_adjustment.h"
#include "cluster/collective.h"
#include "cluster/stages/block_hash.h"
#include "cluster/stages/stages.h"
#include "io/error.h"
#include "io/hash.h"
#include "io/unit_files.h"

namespace megablock {

namespace {

TileAdjustment adjust_one(const Job& job, const BlockState& oriented, const Tiles& tiles, TileIndex tile,
                          const std::string& tracks_unit) {
  const AdjustOptions& options = job.settings.adjustment;
  const TrackSet tracks = read_tracks(job.store.verified_path(tracks_unit));
  TileProblem problem = make_tile_problem(job.block, oriented, tiles, tile, tracks, options.observations);
  const Eigen::Vector3d unknown = Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  TileState state = make_tile_state(problem, oriented, std::vector<Eigen::Vector3d>(problem.points.size(), unknown));
  const AdjustSummary summary = adjust_tile(problem, state, options);

  TileAdjustment result;
  result.frames = problem.frames;
  result.poses = state.frames;
  result.cameras = problem.cameras;
  result.intrinsics = state.cameras;
  result.observations.assign(problem.frames.size(), 0);
  result.camera_observations.assign(problem.cameras.size(), 0);
  for (std::int64_t o = 0; o < problem.observation_count(); ++o) {
    if (!problem.kept[o]) continue;
    const TileImage& image = problem.images[static_cast<std::size_t>(problem.image[o].value)];
    ++result.observations[static_cast<std::size_t>(image.frame.value)];
    ++result.camera_observations[static_cast<std::size_t>(image.camera.value)];
  }
  result.points = std::move(state.points);
  result.kept = std::move(problem.kept);
  result.summary = summary.text;
  return result;
}

// Everything of the block that can reach a tile's adjustment: its frames' values and priors, its cameras, its control.
void add_tile_values(Hasher& hasher, const Job& job, const BlockState& state, const Tiles& tiles, TileIndex tile,
                     const TrackSet& tracks) {
  std::vector<FrameIndex> frames;
  for (const ImageIndex image : tracks.image) frames.push_back(job.block.images[image].frame);
  for (std::size_t f = 0; f < tiles.tile_of_frame.size(); ++f)
    if (tiles.tile_of_frame[FrameIndex(static_cast<std::int64_t>(f))] == tile)
      frames.push_back(FrameIndex(static_cast<std::int64_t>(f)));
  std::sort(frames.begin(), frames.end());
  frames.erase(std::unique(frames.begin(), frames.end()), frames.end());
  for (const FrameIndex f : frames) {
    hasher.add(f.value).add(state.oriented[f]).add(tiles.tile_of_frame[f].value);
    add_to_hash(hasher, state.frames[f]);
    add_priors_to_hash(hasher, job.block.frames[f]);
  }
  for (std::size_t c = 0; c < state.cameras.size(); ++c) {
    const CameraIndex camera(static_cast<std::int64_t>(c));
    for (const double value : state.cameras[camera]) hasher.add(value);
    for (const double value : job.block.cameras[camera].prior_sigma) hasher.add(value);
  }
  for (const ControlPoint& point : job.block.control_points) {
    hasher.add(point.name).add(point.role);
    add_to_hash(hasher, point.position);
    add_to_hash(hasher, point.sigma);
    for (const ImageMeasurement& m : point.measurements)
      hasher.add(m.image.value).add(m.pixel.x()).add(m.pixel.y()).add(m.sigma_px);
  }
}

}  // namespace

std::vector<std::string> run_adjustment(Job& job, const BlockState& oriented, const Tiles& tiles,
                                        const std::vector<std::string>& tracks) {
  std::vector<Unit> units;
  std::vector<std::string> names;
  for (std::size_t t = 0; t < tracks.size(); ++t) {
    const TileIndex tile(static_cast<std::int64_t>(t));
    const TrackSet owned = read_tracks(job.store.verified_path(tracks[t]));
    Hasher hasher;
    hasher.add(algorithm::kAdjustment).add(job.store.seal(tracks[t])->content_hash);
    add_to_hash(hasher, job.settings.adjustment);
    add_tile_values(hasher, job, oriented, tiles, tile, owned);
    Unit unit;
    unit.name = unit_name("adjust", tile.value);
    unit.fingerprint = hasher.value();
    unit.cost = static_cast<double>(owned.observation_count());
    unit.write = [&job, &oriented, &tiles, tile, track = tracks[t]](const std::string& path) {
      write_adjustment(path, adjust_one(job, oriented, tiles, tile, track));
    };
    names.push_back(unit.name);
    units.push_back(std::move(unit));
  }
  const StageOutcome outcome = run_stage(job, "adjustment", units);
  for (const FailedUnit& failure : outcome.failures) std::erase(names, failure.unit);
  if (names.empty()) throw AgreedError<ComputeError>("no tile could be adjusted: " + outcome.failures.front().reason);
  for (std::size_t t = 0; t < tracks.size(); ++t) {
    const std::string name = unit_name("adjust", static_cast<std::int64_t>(t));
    if (std::find(names.begin(), names.end(), name) == names.end()) names.insert(names.begin() + static_cast<long>(t), "");
  }
  return names;
}

}  // namespace megablock
