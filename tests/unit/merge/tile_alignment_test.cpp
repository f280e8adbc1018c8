// Pieces of a known block, each moved by a similarity of its own, come together again.
#include "merge/tile_alignment.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "geometry/rotation.h"

namespace megablock {
namespace {

constexpr int kTiles = 6, kFrames = 30, kCommon = 10;  // along a line; neighbours share kCommon frames

Pose true_pose(std::int64_t frame) {
  const double f = static_cast<double>(frame);
  return {rotation_exp<double>({0.02 * std::sin(f), 0.03 * std::cos(2 * f), 0.01 * f}),
          {5 * f, 20 * std::sin(0.4 * f), 3 * std::cos(f)}};
}

std::vector<AlignmentTile> pieces(double shift_m, double noise_m) {
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
double largest_gap(const std::vector<AlignmentTile>& tiles, const std::vector<Similarity>& moves) {
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

TEST(TileAlignment, BringsExactPiecesTogether) {
  const std::vector<AlignmentTile> tiles = pieces(1, 0);
  EXPECT_GT(largest_gap(tiles, std::vector<Similarity>(kTiles)), 1);
  EXPECT_LE(largest_gap(tiles, align_tiles(tiles)), 1e-4);
}

TEST(TileAlignment, LeavesNoMoreThanTheNoise) {
  const std::vector<AlignmentTile> tiles = pieces(1, 0.02);
  EXPECT_LE(largest_gap(tiles, align_tiles(tiles)), 0.15);
}

TEST(TileAlignment, FramesThatHangOnFewPointsDoNotBendIt) {
  std::vector<AlignmentTile> tiles = pieces(1, 0.01), wrong = tiles;
  for (std::size_t t = 0; t < wrong.size(); ++t) {
    wrong[t].poses[2].centre += Eigen::Vector3d(15, -8, 20);  // a tail of the loss
    wrong[t].poses[4].centre += Eigen::Vector3d(-300, 0, 100);
    wrong[t].observations[4] = tiles[t].observations[4] = 7;  // too few to be heard
  }
  EXPECT_LE(largest_gap(tiles, align_tiles(wrong)), 0.1);
}

TEST(TileAlignment, StaysWhereTheTilesSayTheyAre) {
  const std::vector<AlignmentTile> tiles = pieces(1, 0.02);
  const std::vector<Similarity> moves = align_tiles(tiles);
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (std::size_t t = 0; t < tiles.size(); ++t)
    for (std::size_t i = 0; i < tiles[t].poses.size(); ++i)
      mean += (moves[t](tiles[t].poses[i].centre) - true_pose(tiles[t].frames[i].value).centre) / (kTiles * kFrames);
  EXPECT_LE(mean.norm(), 2.5);
}

TEST(TileAlignment, TilesThatShareNothingStay) {
  std::vector<AlignmentTile> tiles = pieces(1, 0);
  tiles.resize(1);
  tiles.push_back({});
  for (const Similarity& s : align_tiles(tiles)) {
    EXPECT_EQ(s.scale, 1);
    EXPECT_EQ(s.translation, Eigen::Vector3d::Zero());
    EXPECT_EQ(s.rotation.coeffs(), Eigen::Quaterniond::Identity().coeffs());
  }
  EXPECT_TRUE(align_tiles({}).empty());
}

}  // namespace
}  // namespace megablock
