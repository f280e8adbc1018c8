#include "cluster/stages/merge_start.h"

#include <algorithm>
#include <limits>

#include "adjust/tile_adjustment.h"
#include "geometry/similarity.h"

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

// Brings a tile without datum onto the initial orientation of its frames; robust, as single frames may have moved.
void align(TileAdjustment& tile, const BlockState& oriented) {
  std::vector<Eigen::Vector3d> from, to;
  Eigen::AlignedBox3d extent;
  for (std::size_t i = 0; i < tile.frames.size(); ++i) {
    from.push_back(tile.poses[i].centre);
    to.push_back(oriented.frames[tile.frames[i]].centre);
    extent.extend(to.back());
  }
  constexpr double kSigmaShare = 1e-3;  // of the tile's extent: what the initial orientation is good for
  const std::vector<double> sigma(from.size(), kSigmaShare * extent.diagonal().norm());
  const std::optional<Similarity> similarity = fit_similarity_robust(from, to, sigma);
  if (!similarity) return;
  for (Pose& pose : tile.poses) pose = (*similarity)(pose);
}

}  // namespace

// Three points fix the pose of a camera; a frame with fewer than twice as many would hang on single observations.
constexpr std::int64_t kFewestObservations = 6;

BlockState merge_start(const Job& job, const BlockState& oriented, const std::vector<std::string>& adjusted) {
  const bool datum = has_datum(job);
  BlockState start = oriented;
  IndexedVector<FrameIndex, std::int64_t> richest(job.block.frames.size(), 0), total(job.block.frames.size(), 0);
  std::vector<std::array<double, kIntrinsicCount>> sums(job.block.cameras.size());
  std::vector<double> weights(job.block.cameras.size(), 0);
  for (const std::string& name : adjusted) {
    if (name.empty()) continue;
    TileAdjustment tile = read_adjustment(job.store.verified_path(name));
    if (!datum) align(tile, oriented);
    for (std::size_t i = 0; i < tile.frames.size(); ++i) {
      total[tile.frames[i]] += tile.observations[i];
      if (tile.observations[i] <= richest[tile.frames[i]]) continue;
      richest[tile.frames[i]] = tile.observations[i];
      start.frames[tile.frames[i]] = tile.poses[i];
    }
    for (std::size_t i = 0; i < tile.cameras.size(); ++i) {
      const auto camera = static_cast<std::size_t>(tile.cameras[i].value);
      const auto weight = static_cast<double>(tile.camera_observations[i]);
      for (int p = 0; p < kIntrinsicCount; ++p) sums[camera][p] += weight * tile.intrinsics[i][p];
      weights[camera] += weight;
    }
  }
  for (std::size_t c = 0; c < sums.size(); ++c)
    if (weights[c] > 0)
      for (int p = 0; p < kIntrinsicCount; ++p)
        start.cameras[CameraIndex(static_cast<std::int64_t>(c))][p] = sums[c][p] / weights[c];
  for (std::size_t f = 0; f < richest.size(); ++f) {
    const FrameIndex frame(static_cast<std::int64_t>(f));
    if (total[frame] < kFewestObservations) start.oriented[frame] = 0;
  }
  return start;
}

MergeTile load_merge_tile(const Job& job, const BlockState& state, const Tiles& tiles, TileIndex tile,
                          const std::string& tracks, const std::string& adjusted) {
  MergeTile merge;
  merge.tile = tile;
  merge.tracks = read_tracks(job.store.verified_path(tracks));
  const AdjustOptions& options = job.settings.adjustment;
  merge.problem = make_tile_problem(job.block, state, tiles, tile, merge.tracks, options.observations);
  const std::size_t points = merge.problem.points.size();
  const Eigen::Vector3d unknown = Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  merge.state = make_tile_state(merge.problem, state, std::vector<Eigen::Vector3d>(points, unknown));
  if (adjusted.empty()) {
    std::fill(merge.problem.kept.begin(), merge.problem.kept.end(), std::uint8_t{0});
    return merge;
  }
  const TileAdjustment adjustment = read_adjustment(job.store.verified_path(adjusted));
  for (std::size_t o = 0; o < merge.problem.kept.size(); ++o) merge.problem.kept[o] &= adjustment.kept[o];
  merge.state.points = adjustment.points;
  triangulate_points(merge.problem, merge.state, options);
  return merge;
}

}  // namespace megablock
