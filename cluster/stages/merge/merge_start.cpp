#include "cluster/stages/merge/merge_start.h"

#include <algorithm>
#include <limits>

#include "adjust/orientation/turned_stretches.h"
#include "adjust/problem/environment_correction.h"
#include "adjust/terms/build_problem.h"
#include "adjust/terms/vertical_terms.h"
#include "adjust/tile/rolling_start.h"
#include "adjust/tile/tile_adjustment.h"
#include "adjust/tile/track_parts.h"
#include "cluster/process/process_memory.h"
#include "geometry/similarity/similarity.h"
#include "geometry/transform/rotation.h"
#include "io/store/units/adjustment_file.h"
#include "io/store/units/tracks_file.h"
#include "merge/start/tile_alignment.h"
#include "merge/start/tile_assembly.h"

namespace megablock {

namespace {

bool has_datum(const Job& job) {
  const Block& block = job.block;
  const bool priors = job.settings.adjustment.observations.use_position_priors &&
                      std::any_of(block.frames.begin(), block.frames.end(),
                                  [](const Frame& frame) { return frame.position_prior.has_value(); });
  const auto control = std::count_if(block.control_points.begin(), block.control_points.end(),
                                     [](const ControlPoint& p) { return p.role == PointRole::kControl; });
  return priors || control >= 3;
}

// The similarities that move each tile from its own adjustment to where all tiles fit together. Also moves the tiles.
std::vector<Similarity> bring_together(const Job& job, std::vector<AlignmentTile>& tiles) {
  std::vector<Similarity> motions(tiles.size());
  const auto move = [&](const std::vector<Similarity>& further) {
    for (std::size_t t = 0; t < tiles.size(); ++t) {
      for (Pose& pose : tiles[t].poses) pose = further[t](pose);
      motions[t] = further[t] * motions[t];
    }
  };
  if (!has_datum(job)) move(assemble_tiles(tiles));
  move(align_tiles(tiles));
  return motions;
}

// The means of the values that tiles share, weighted by observations.
class SharedMeans {
 public:
  explicit SharedMeans(const Block& block) : block_(block), cameras_(block.cameras.size()) {
    for (const Rig& rig : block.rigs) mounts_.emplace_back(rig.mounts.size());
  }

  void add(const TileAdjustment& tile) {
    for (std::size_t i = 0; i < tile.cameras.size(); ++i) {
      CameraMean& mean = cameras_[tile.cameras[i]];
      const auto weight = static_cast<double>(tile.camera_observations[i]);
      for (int p = 0; p < tile.intrinsics[i].size(); ++p) mean.sum[p] += weight * tile.intrinsics[i][p];
      mean.weight += weight;
    }
    for (std::size_t i = 0; i < tile.mounts.size(); ++i) {
      const auto number = static_cast<std::size_t>(tile.mount_numbers[i]);
      if (block_.rigs[tile.mount_rigs[i]].mounts[number].held()) continue;
      MountMean& mean = mounts_[static_cast<std::size_t>(tile.mount_rigs[i].value)][number];
      const auto weight = static_cast<double>(tile.mount_observations[i]);
      if (mean.weight == 0) mean.first = tile.mounts[i];
      PoseIncrement difference;
      difference << rotation_log<double>(mean.first.rotation.conjugate() * tile.mounts[i].rotation),
          tile.mounts[i].centre - mean.first.centre;
      mean.sum += weight * difference;
      mean.weight += weight;
    }
  }

  void store(BlockState& state) const {
    for (std::size_t c = 0; c < cameras_.size(); ++c) {
      const CameraMean& mean = cameras_[CameraIndex(static_cast<std::int64_t>(c))];
      Intrinsics& camera = state.cameras[CameraIndex(static_cast<std::int64_t>(c))];
      for (int p = 0; mean.weight > 0 && p < camera.size(); ++p) camera[p] = mean.sum[p] / mean.weight;
    }
    for (std::size_t r = 0; r < mounts_.size(); ++r)
      for (std::size_t m = 0; m < mounts_[r].size(); ++m) {
        const MountMean& mean = mounts_[r][m];
        if (mean.weight > 0)
          state.mounts[RigIndex(static_cast<std::int64_t>(r))][m] = pose_update(mean.first, mean.sum / mean.weight);
      }
  }

 private:
  struct CameraMean {
    std::array<double, kMaxIntrinsics> sum{};
    double weight = 0;
  };
  struct MountMean {
    Pose first;
    PoseIncrement sum = PoseIncrement::Zero();  // of differences from the first tile's pose
    double weight = 0;
  };
  const Block& block_;
  IndexedVector<CameraIndex, CameraMean> cameras_;
  std::vector<std::vector<MountMean>> mounts_;  // [rigs][mounts]
};

// Three points fix the pose of a camera. A frame with fewer than twice as many would depend on single observations.
constexpr std::int64_t kFewestObservations = 6;

// Takes the pose of every frame from the tile that holds most of its observations.
void take_richest(const std::vector<AlignmentTile>& tiles, const std::vector<TileIndex>& numbers, MergeStart& start) {
  struct Observations {
    std::int64_t richest = 0, total = 0;  // in the tile that has most of them, in all tiles
  };
  BlockState& state = start.state;
  IndexedVector<FrameIndex, Observations> observations(state.frames.size());
  for (std::size_t t = 0; t < tiles.size(); ++t) {
    for (std::size_t i = 0; i < tiles[t].frames.size(); ++i) {
      const FrameIndex frame = tiles[t].frames[i];
      Observations& seen = observations[frame];
      seen.total += tiles[t].observations[i];
      if (tiles[t].observations[i] <= seen.richest) continue;
      seen.richest = tiles[t].observations[i];
      state.frames[frame] = tiles[t].poses[i];
      start.tile_of_frame[frame] = numbers[t];
    }
  }
  for (FrameIndex f(0); observations.contains(f); ++f.value)
    if (observations[f].total < kFewestObservations) state.oriented[f] = 0;
}

// [points] Marks points with a frame that has not moved with the tile, and points without a position.
std::vector<std::uint8_t> left_behind(const MergeTile& merge, const MergeStart& start) {
  const TileProblem& problem = merge.problem;
  std::vector<std::uint8_t> result(problem.points.size(), 0);
  for (std::int64_t p = 0; p < problem.point_count(); ++p) {
    result[p] = !merge.state.points[static_cast<std::size_t>(p)].allFinite();
    for (std::int64_t row = problem.begin[p]; row < problem.begin[p + 1] && !result[p]; ++row) {
      if (!problem.kept[row]) continue;
      const LocalFrame frame = problem.images[problem.image[row].value].frame;
      result[p] = start.tile_of_frame[problem.frames[frame.value]] != merge.tile;
    }
  }
  return result;
}

// Picks the values of `wanted` from `values`, whose ascending keys are `keys`, where they exist.
template <typename Key, typename Value>
void take_known(const std::vector<Key>& keys, const std::vector<Value>& values, const std::vector<Key>& wanted,
                std::vector<Value>& to) {
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    const auto it = std::lower_bound(keys.begin(), keys.end(), wanted[i]);
    if (it != keys.end() && *it == wanted[i]) to[i] = values[static_cast<std::size_t>(it - keys.begin())];
  }
}

// The state of a tile after its own adjustment. A run that resumes in the middle of the merge has the same state, and
// corrects measurements by the same bits.
TileState own_solution(const TileProblem& problem, const TileAdjustment& adjustment, TileState state) {
  std::vector<MountId> mounts;
  for (std::size_t m = 0; m < adjustment.mounts.size(); ++m)
    mounts.push_back({adjustment.mount_rigs[m], adjustment.mount_numbers[m]});
  take_known(adjustment.frames, adjustment.poses, problem.frames, state.frames);
  take_known(adjustment.cameras, adjustment.intrinsics, problem.cameras, state.cameras);
  take_known(mounts, adjustment.mounts, problem.mounts, state.mounts);
  return state;
}

// The measurements as the solution of the tile corrects them. Points of parts that were put back are not known in it.
void correct_tile(const Job& job, const BlockState& oriented, const std::optional<FramePaths>& paths, TileState at,
                  TileProblem& problem) {
  if (paths)
    correct_rolling_start({*paths, tile_readouts(job.block, problem), oriented}, job.settings.adjustment, problem, at);
  correct_measurements(job.settings.environment, job.block.ground, at, problem);
}

bool any_free(const TileProblem& problem) {
  const auto set = [](auto flag) { return flag != 0; };
  return std::any_of(problem.camera_free.begin(), problem.camera_free.end(), set) ||
         std::any_of(problem.mount_free.begin(), problem.mount_free.end(), set);
}

}  // namespace

MergeStart merge_start(const Job& job, const BlockState& oriented, const std::vector<std::string>& adjusted) {
  MergeStart start{oriented, std::vector<Similarity>(adjusted.size()), {}, {}};
  start.tile_of_frame.assign(oriented.frames.size(), TileIndex());
  std::vector<AlignmentTile> tiles;
  std::vector<TileIndex> numbers;  // [tiles]
  SharedMeans means(job.block);
  for (std::size_t t = 0; t < adjusted.size(); ++t) {
    if (adjusted[t].empty()) continue;
    TileAdjustment tile = read_adjustment(job.store.verified_path(adjusted[t]));
    means.add(tile);
    for (const std::int64_t row : tile.control_aside) start.aside.push_back({row, 1});
    tiles.push_back({std::move(tile.frames), std::move(tile.poses), std::move(tile.observations)});
    numbers.emplace_back(static_cast<std::int64_t>(t));
  }
  std::ranges::sort(start.aside);
  start.aside.erase(std::ranges::unique(start.aside).begin(), start.aside.end());
  const std::vector<Similarity> motions = bring_together(job, tiles);
  for (std::size_t i = 0; i < tiles.size(); ++i) start.motions[static_cast<std::size_t>(numbers[i].value)] = motions[i];
  take_richest(tiles, numbers, start);
  return_freed_memory();  // the other data of the adjustments, before all frames are read
  const IndexedVector<FrameIndex, Pose> before = start.state.frames;
  turn_back_stretches(job.block, oriented, start.state);
  for (FrameIndex f(0); before.contains(f); ++f.value)
    if (before[f].centre != start.state.frames[f].centre ||
        before[f].rotation.coeffs() != start.state.frames[f].rotation.coeffs())
      start.tile_of_frame[f] = TileIndex();
  means.store(start.state);
  return start;
}

TrackSet read_split_tracks(const Job& job, const std::string& tracks, const std::string& adjusted) {
  TrackSet all = read_tracks(job.store.verified_path(tracks));
  return adjusted.empty() ? all : split_tracks(all, read_adjustment(job.store.verified_path(adjusted)).parts);
}

MergeTile load_merge_tile(const Job& job, const BlockState& oriented, const MergeStart& start, const Tiles& tiles,
                          TileIndex tile, const RowsOfTile& rows, const std::string& tracks,
                          const std::string& adjusted) {
  const BlockState& state = start.state;
  MergeTile merge;
  merge.tile = tile;
  merge.tracks = read_tracks(job.store.verified_path(tracks));
  TileAdjustment adjustment;
  if (!adjusted.empty()) {
    adjustment = read_adjustment(job.store.verified_path(adjusted));
    merge.tracks = split_tracks(merge.tracks, adjustment.parts);
  }
  const AdjustOptions& options = job.settings.adjustment;
  merge.problem = make_tile_problem(job.block, state, tiles, tile, merge.tracks, options.observations, rows);
  take_plumb_lines(job.block, oriented, merge.problem);
  const std::size_t points = merge.problem.points.size();
  const Eigen::Vector3d unknown = Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  merge.state = make_tile_state(merge.problem, state, std::vector<Eigen::Vector3d>(points, unknown));
  if (adjusted.empty()) {
    std::fill(merge.problem.kept.begin(), merge.problem.kept.end(), std::uint8_t{0});
    return merge;
  }
  for (std::size_t o = 0; o < merge.problem.kept.size(); ++o) merge.problem.kept[o] &= adjustment.kept[o];
  merge.state.points = adjustment.points;
  correct_tile(job, oriented, start.paths, own_solution(merge.problem, adjustment, merge.state), merge.problem);
  if (start.motions.empty()) return merge;
  const Similarity& motion = start.motions[static_cast<std::size_t>(tile.value)];
  for (Eigen::Vector3d& point : merge.state.points) point = motion(point);
  if (any_free(merge.problem))
    triangulate_points(merge.problem, merge.state, options);
  else
    triangulate_points(merge.problem, merge.state, options, left_behind(merge, start));
  return merge;
}

}  // namespace megablock
