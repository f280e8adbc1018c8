// Cuts a known line of frames into overlapping pieces, each of which is moved by its own similarity.
#pragma once

#include <algorithm>
#include <cmath>
#include <random>

#include "geometry/transform/rotation.h"
#include "merge/start/tile_alignment.h"

namespace megablock::moved_pieces {

inline constexpr int kTiles = 6, kFrames = 30, kCommon = 10;  // along a line; neighbours share kCommon frames

inline Pose true_pose(std::int64_t frame) {
  const double f = static_cast<double>(frame);
  return {rotation_exp<double>({0.02 * std::sin(f), 0.03 * std::cos(2 * f), 0.01 * f}),
          {5 * f, 20 * std::sin(0.4 * f), 3 * std::cos(f)}};
}

inline std::vector<AlignmentTile> pieces(double shift_m, double noise_m) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> gauss;
  const auto vector = [&](double sigma) -> Eigen::Vector3d {
    return sigma * Eigen::Vector3d(gauss(random), gauss(random), gauss(random));
  };
  std::vector<AlignmentTile> tiles(kTiles);
  for (int t = 0; t < kTiles; ++t) {
    Similarity moved;
    moved.rotation = rotation_exp<double>(vector(0.01 * shift_m));
    moved.scale = 1 + 0.002 * shift_m * gauss(random);
    const std::int64_t first = t * (kFrames - kCommon);
    const Eigen::Vector3d middle = true_pose(first + kFrames / 2).centre;
    moved.translation = middle - moved.scale * (moved.rotation * middle) + vector(shift_m);
    for (std::int64_t f = first; f < first + kFrames; ++f) {
      Pose pose = moved(true_pose(f));
      pose.centre += vector(noise_m);
      pose.rotation = pose.rotation * rotation_exp<double>(vector(noise_m / 100));
      tiles[static_cast<std::size_t>(t)].frames.push_back(FrameIndex(f));
      tiles[static_cast<std::size_t>(t)].poses.push_back(pose);
      tiles[static_cast<std::size_t>(t)].observations.push_back(100 + (f + t) % 50);
    }
  }
  return tiles;
}

// Largest difference of a frame between two tiles.
inline double largest_gap(const std::vector<AlignmentTile>& tiles, const std::vector<Similarity>& moves) {
  double largest = 0;
  for (std::size_t t = 1; t < tiles.size(); ++t)
    for (int i = 0; i < kCommon; ++i) {
      const std::size_t before = static_cast<std::size_t>(kFrames - kCommon + i), here = static_cast<std::size_t>(i);
      if (tiles[t].observations[here] < 20 || tiles[t - 1].observations[before] < 20) continue;
      largest = std::max(
          largest, (moves[t](tiles[t].poses[here]).centre - moves[t - 1](tiles[t - 1].poses[before]).centre).norm());
    }
  return largest;
}

}  // namespace megablock::moved_pieces
