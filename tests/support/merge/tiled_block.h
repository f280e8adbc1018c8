// Cuts a simulated block into tiles with states near the truth, and also makes one problem of the same block.
#pragma once

#include <algorithm>
#include <map>
#include <random>

#include "adjust/problem/tile_problem.h"
#include "adjust/terms/build_problem.h"
#include "io/simulate/blocks/simulate.h"
#include "merge/tree/merge_in_memory.h"
#include "partition/tiles/tiles.h"

namespace megablock {

struct TiledBlock {
  SimulatedBlock simulated;
  Tiles tiles;
  std::vector<TileProblem> problems;
  std::vector<TileState> states;
  TileProblem whole;
  TileState whole_state;

  // `noise`: start poses off the truth by that many metres and milliradians, points by as many metres.
  TiledBlock(SimulatedBlock block, std::int64_t tile_max_frames, const ObservationOptions& options, double noise)
      : simulated(std::move(block)) {
    BlockState start = simulated.truth;
    if (noise > 0) start.cameras = initial_state(simulated.block).cameras;
    for (std::size_t f = 0; f < start.frames.size(); ++f) {
      std::mt19937_64 random(1000 + f);
      std::normal_distribution<double> gauss(0, noise);
      PoseIncrement d;
      for (int k = 0; k < 6; ++k) d[k] = gauss(random) * (k < 3 ? 1e-3 : 1.0);
      start.frames[FrameIndex(static_cast<std::int64_t>(f))] =
          pose_update(start.frames[FrameIndex(static_cast<std::int64_t>(f))], d);
    }
    points_ = simulated.points;
    control_points_ = simulated.control_truth;
    for (std::size_t p = 0; p < points_.size(); ++p) shift(points_[p], 5000 + p, noise);
    for (std::size_t p = 0; p < control_points_.size(); ++p) shift(control_points_[p], 900000 + p, noise);
    cut(tile_max_frames);
    for (std::int64_t t = 0; t < tiles.tile_count; ++t) {
      problems.push_back(make_tile_problem(simulated.block, start, tiles, TileIndex(t), owned_by(t), options));
      states.push_back(make_tile_state(problems.back(), start, points_of(problems.back())));
    }
    Tiles one = tiles;
    one.tile_count = 1;
    for (TileIndex& tile : one.tile_of_frame) tile = TileIndex(0);
    whole = make_tile_problem(simulated.block, start, one, TileIndex(0), simulated.tracks, options);
    whole_state = make_tile_state(whole, start, points_of(whole));
  }

  int levels() const {
    int level = 0;
    for (const auto& node : tiles.tree.nodes) level = std::max(level, node.level);
    return level;
  }

  // Copies a solution of the tiles into the state of the whole.
  TileState gathered(const std::vector<TileProblem>& tile_problems, const std::vector<TileState>& solution) const {
    TileState state = whole_state;
    for (std::size_t t = 0; t < tile_problems.size(); ++t) {
      const TileProblem& tile = tile_problems[t];
      for (std::size_t r = 0; r < tile.frames.size(); ++r)
        state.frames[row(whole.frames, tile.frames[r])] = solution[t].frames[r];
      for (std::size_t r = 0; r < tile.cameras.size(); ++r)
        state.cameras[row(whole.cameras, tile.cameras[r])] = solution[t].cameras[r];
      for (std::size_t r = 0; r < tile.mounts.size(); ++r)
        state.mounts[row(whole.mounts, tile.mounts[r])] = solution[t].mounts[r];
      for (std::size_t r = 0; r < tile.points.size(); ++r)
        state.points[point_row(tile.points[r])] = solution[t].points[r];
    }
    return state;
  }

  std::size_t point_row(const TilePoint& point) const {
    const auto tracks = static_cast<std::int64_t>(simulated.points.size());
    if (point.role == PointRole::kTie) return static_cast<std::size_t>(point.index);
    for (std::size_t r = static_cast<std::size_t>(tracks); r < whole.points.size(); ++r)
      if (whole.points[r].index == point.index) return r;
    return whole.points.size();
  }

  template <typename Value>
  static std::size_t row(const std::vector<Value>& table, const Value& value) {
    return static_cast<std::size_t>(std::lower_bound(table.begin(), table.end(), value) - table.begin());
  }

 private:
  static void shift(Eigen::Vector3d& point, std::uint64_t seed, double noise) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> gauss(0, noise);
    for (int k = 0; k < 3; ++k) point[k] += gauss(random);
  }

  void cut(std::int64_t tile_max_frames) {
    std::map<std::pair<FrameIndex, FrameIndex>, std::int64_t> weights;
    const TrackSet& tracks = simulated.tracks;
    for (std::int64_t t = 0; t < tracks.track_count(); ++t)
      for (std::int64_t a = tracks.begin[t]; a < tracks.begin[t + 1]; ++a)
        for (std::int64_t b = a + 1; b < tracks.begin[t + 1]; ++b) {
          const FrameIndex fa = simulated.block.images[tracks.image[a]].frame;
          const FrameIndex fb = simulated.block.images[tracks.image[b]].frame;
          if (fa != fb) ++weights[{std::min(fa, fb), std::max(fa, fb)}];
        }
    FrameGraph graph;
    graph.frame_count = static_cast<std::int64_t>(simulated.block.frames.size());
    for (const auto& [pair, weight] : weights) graph.edges.push_back({pair.first, pair.second, weight});
    TileOptions options;
    options.tile_max_frames = tile_max_frames;
    tiles = make_tiles(graph, options);
  }

  TrackSet owned_by(std::int64_t tile) const {
    const TrackSet& all = simulated.tracks;
    TrackSet owned;
    owned.begin.push_back(0);
    for (std::int64_t t = 0; t < all.track_count(); ++t) {
      const ImageIndex* first = all.image.data() + all.begin[t];
      const ImageIndex* last = all.image.data() + all.begin[t + 1];
      if (owner_tile(simulated.block, tiles, first, last).value != tile) continue;
      owned.id.push_back(all.id[t]);
      for (std::int64_t row = all.begin[t]; row < all.begin[t + 1]; ++row) {
        owned.image.push_back(all.image[row]);
        owned.x.push_back(all.x[row]);
        owned.y.push_back(all.y[row]);
        owned.feature.push_back(all.feature[row]);
      }
      owned.begin.push_back(owned.observation_count());
    }
    return owned;
  }

  std::vector<Eigen::Vector3d> points_of(const TileProblem& problem) const {
    std::vector<Eigen::Vector3d> values;
    for (const TilePoint& point : problem.points)
      values.push_back(
          (point.role == PointRole::kTie ? points_ : control_points_)[static_cast<std::size_t>(point.index)]);
    return values;
  }

  std::vector<Eigen::Vector3d> points_, control_points_;
};

}  // namespace megablock
