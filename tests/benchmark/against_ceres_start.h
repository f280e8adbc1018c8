// Writes and reads what the programs of against_ceres.cpp start from: the tiles, observations, points and sigmas of a
// result, with every component of every pose moved by a normal deviate of its sigma.
#pragma once

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <vector>

#include "adjust/terms/build_problem.h"
#include "adjust/tile/image_sigma.h"
#include "adjust/tile/sigma_scales.h"
#include "cluster/outcome/monolithic_comparison.h"
#include "io/result/result.h"
#include "io/store/hdf5/hdf5_file.h"
#include "io/store/units/block_file.h"
#include "io/store/units/graph_files.h"
#include "io/store/units/state_file.h"
#include "io/store/units/tracks_file.h"
#include "merge/tree/merge_tree_runner.h"
#include "tests/benchmark/scenes.h"

namespace megablock {

// What both sides start from, as files in one folder.
struct Start {
  std::filesystem::path folder;  // of the block
  int ranks = 2;                 // of ours
  std::filesystem::path job() const { return folder / "job"; }
  std::string file(const std::string& name) const { return (folder / "start" / name).string(); }
  std::string tracks(std::int64_t tile) const { return file("tracks-" + std::to_string(tile) + ".h5"); }
  std::string points(std::int64_t tile) const { return file("points-" + std::to_string(tile) + ".h5"); }
};

inline void write_points(const std::string& path, const std::vector<double>& coordinates) {
  Hdf5Writer file(path, "points");
  file.matrix("position", coordinates, 3);
  file.close();
}

inline std::vector<Eigen::Vector3d> read_points(const std::string& path) {
  const std::vector<double> values = Hdf5Reader(path, "points").matrix<double>("position", 3);
  std::vector<Eigen::Vector3d> points;
  for (std::size_t i = 0; i < values.size(); i += 3) points.emplace_back(values[i], values[i + 1], values[i + 2]);
  return points;
}

// Tracks with two or more kept observations, without the others, and their points.
inline void write_tile(const Start& start, const BlockResult& result, std::int64_t tile) {
  TrackSet tracks;
  tracks.begin = {0};
  std::vector<double> points;
  for (std::size_t t = 0; t < result.points.size(); ++t) {
    const auto first = static_cast<std::size_t>(result.tracks.begin[t]),
               last = static_cast<std::size_t>(result.tracks.begin[t + 1]);
    if (result.file_tiles[t] != TileIndex(tile) || !result.points[t].allFinite() ||
        std::count(result.kept.begin() + static_cast<std::ptrdiff_t>(first),
                   result.kept.begin() + static_cast<std::ptrdiff_t>(last), 1) < 2)
      continue;
    for (std::size_t o = first; o < last; ++o) {
      if (!result.kept[o]) continue;
      tracks.image.push_back(result.tracks.image[o]);
      tracks.x.push_back(result.tracks.x[o]);
      tracks.y.push_back(result.tracks.y[o]);
      tracks.feature.push_back(result.tracks.feature[o]);
    }
    tracks.id.push_back(result.tracks.id[t]);
    tracks.begin.push_back(tracks.observation_count());
    points.insert(points.end(), result.points[t].data(), result.points[t].data() + 3);
  }
  write_tracks(start.tracks(tile), tracks);
  write_points(start.points(tile), points);
}

inline BlockState moved(const BlockResult& result, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> gauss;
  BlockState state = result.state;
  for (FrameIndex f(0); state.frames.contains(f); ++f.value) {
    PoseIncrement d;
    for (int k = 0; k < 6; ++k) d[k] = gauss(random) * std::sqrt(result.frame_covariance[f](k, k));
    if (state.oriented[f]) state.frames[f] = pose_update(state.frames[f], d);
  }
  return state;
}

inline void write_start(const Start& start, const BlockResult& result, std::uint64_t seed) {
  for (std::int64_t t = 0; t < result.tiles.tile_count; ++t) write_tile(start, result, t);
  write_state(start.file("state.h5"), moved(result, seed));
  write_tiles(start.file("tiles.h5"), result.tiles);
  nlohmann::json sigmas{{"image_sigma_px", result.image_sigma_px}};
  for (std::size_t k = 0; k < kObservationKinds; ++k)
    sigmas["scales"].push_back(result.observation_table.kinds[k].scale);
  for (const PositionScale& scale : result.position_scales)
    sigmas["groups"].push_back({scale.group.value, scale.horizontal, scale.height});
  std::ofstream(start.file("sigmas.json")) << sigmas;
}

// Everything but the tracks.
struct Inputs {
  explicit Inputs(const Start& start)
      : block(read_block((start.job() / "block.h5").string())),
        state(read_state(start.file("state.h5"))),
        tiles(read_tiles(start.file("tiles.h5"))),
        options(observation_options(JobStore(start.job().string()))) {
    std::ifstream in(start.file("sigmas.json"));
    const nlohmann::json sigmas = nlohmann::json::parse(in);
    image_sigma_px = sigmas["image_sigma_px"];
    for (std::size_t k = 0; k < kObservationKinds; ++k) scales.of[k] = sigmas["scales"][k];
    if (sigmas.contains("groups"))
      for (const nlohmann::json& group : sigmas["groups"])
        scales.set_positions({RigIndex(group[0].get<std::int64_t>()), group[1], group[2]});
  }
  RankTile tile(const Tiles& partition, TileIndex number, const TrackSet& tracks,
                std::vector<Eigen::Vector3d> points) const {
    RankTile made{number.value, make_tile_problem(block, state, partition, number, tracks, options), {}};
    set_image_sigma(made.problem, image_sigma_px);
    scale_sigmas(made.problem, scales);
    points.resize(made.problem.points.size(), Eigen::Vector3d::Constant(std::nan("")));
    made.state = make_tile_state(made.problem, state, std::move(points));
    return made;
  }

  Block block;
  BlockState state;
  Tiles tiles;
  ObservationOptions options;
  double image_sigma_px = 0;
  SigmaScales scales;
};

}  // namespace megablock
