// Pieces of a known block, each in a frame of its own, in one frame again.
#include "merge/start/tile_assembly.h"

#include <gtest/gtest.h>

#include <limits>

#include "tests/support/merge/moved_pieces.h"

namespace megablock {
namespace {

using namespace moved_pieces;

constexpr double kLargest = 0.4;  // m, of 120 frames with noise of 1 to 2 cm

// Far from one another in place, attitude and scale.
std::vector<AlignmentTile> pieces_apart(double noise_m) {
  std::vector<AlignmentTile> tiles = pieces(0, noise_m);
  std::mt19937_64 random(11);
  std::normal_distribution<double> gauss;
  for (AlignmentTile& tile : tiles) {
    Similarity moved;
    moved.rotation = rotation_exp<double>(Eigen::Vector3d(gauss(random), gauss(random), gauss(random)));
    moved.scale = std::exp(0.5 * gauss(random));
    moved.translation = 1000 * Eigen::Vector3d(gauss(random), gauss(random), gauss(random));
    for (Pose& pose : tile.poses) pose = moved(pose);
  }
  return tiles;
}

// Largest error of a centre against the truth after the best similarity; `wrong`: rows to leave out.
double largest_bend(const std::vector<AlignmentTile>& tiles, const std::vector<Similarity>& moves,
                    const std::vector<std::size_t>& wrong = {}) {
  std::vector<Eigen::Vector3d> from, to;
  for (std::size_t t = 0; t < tiles.size(); ++t)
    for (std::size_t i = 0; i < tiles[t].poses.size(); ++i) {
      if (std::find(wrong.begin(), wrong.end(), i) != wrong.end()) continue;
      from.push_back(moves[t](tiles[t].poses[i].centre));
      to.push_back(true_pose(tiles[t].frames[i].value).centre);
    }
  const Similarity fitted = fit_similarity(from, to).value();
  double largest = 0;
  for (std::size_t i = 0; i < from.size(); ++i) largest = std::max(largest, (fitted(from[i]) - to[i]).norm());
  return largest;
}

// Of each tile, its frames as moved.
std::vector<AlignmentTile> moved_by(std::vector<AlignmentTile> tiles, const std::vector<Similarity>& moves) {
  for (std::size_t t = 0; t < tiles.size(); ++t)
    for (Pose& pose : tiles[t].poses) pose = moves[t](pose);
  return tiles;
}

TEST(TileAssembly, ExactPiecesFitExactly) {
  const std::vector<AlignmentTile> tiles = pieces_apart(0);
  const std::vector<Similarity> moves = assemble_tiles(tiles);
  EXPECT_LE(largest_gap(tiles, moves), 1e-6);
  EXPECT_LE(largest_bend(tiles, moves), 1e-6);
}

TEST(TileAssembly, BendsByTheNoiseOfItsTiles) {
  const std::vector<AlignmentTile> tiles = pieces_apart(0.02);
  EXPECT_LE(largest_bend(tiles, assemble_tiles(tiles)), kLargest);
}

TEST(TileAssembly, FramesThatHaveMovedDoNotBendIt) {
  std::vector<AlignmentTile> wrong = pieces_apart(0.01);
  for (AlignmentTile& tile : wrong) {
    const double size = (tile.poses[20].centre - tile.poses[0].centre).norm() / 100;
    tile.poses[2].centre += size * Eigen::Vector3d(15, -8, 20);
    tile.poses[4].centre += size * Eigen::Vector3d(-300, 0, 100);
    tile.observations[4] = 7;  // too few to be heard
  }
  EXPECT_LE(largest_bend(wrong, assemble_tiles(wrong), {2, 4}), kLargest);
}

TEST(TileAssembly, WhatFitsStaysWhereItIs) {
  const std::vector<AlignmentTile> tiles = pieces(0, 0);
  const std::vector<AlignmentTile> moved = moved_by(tiles, assemble_tiles(tiles));
  for (std::size_t t = 0; t < tiles.size(); ++t)
    for (std::size_t i = 0; i < tiles[t].poses.size(); ++i) {
      EXPECT_LE((moved[t].poses[i].centre - tiles[t].poses[i].centre).norm(), 1e-6);
      EXPECT_LE(moved[t].poses[i].rotation.angularDistance(tiles[t].poses[i].rotation), 1e-8);
    }
}

// Centres on a line, of one or two frames, or in one place say nothing of the turn about them: attitudes do.
TEST(TileAssembly, DoesNotTurnAboutALine) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> gauss;
  for (const double noise_m : {0.0, 1e-3})
    for (const int frames : {1, 2, 30}) {
      std::vector<AlignmentTile> tiles(2);
      for (std::size_t t = 0; t < 2; ++t)
        for (int i = 0; i < frames; ++i) {
          const std::int64_t f = i + (t == 1 ? frames / 2 : 0);
          Pose pose = true_pose(f);
          pose.centre = {5.0 * static_cast<double>(f) + noise_m * gauss(random), noise_m * gauss(random),
                         noise_m * gauss(random)};
          tiles[t].frames.emplace_back(f);
          tiles[t].poses.push_back(pose);
          tiles[t].observations.push_back(100);
        }
      const std::vector<AlignmentTile> moved = moved_by(tiles, assemble_tiles(tiles));
      for (std::size_t t = 0; t < 2; ++t)
        for (std::size_t i = 0; i < tiles[t].poses.size(); ++i) {
          EXPECT_LE((moved[t].poses[i].centre - tiles[t].poses[i].centre).norm(), 10 * noise_m + 1e-6) << frames;
          EXPECT_LE(moved[t].poses[i].rotation.angularDistance(tiles[t].poses[i].rotation), 1e-3) << frames;
        }
    }
}

TEST(TileAssembly, APieceThatSharesNothingStays) {
  std::vector<AlignmentTile> tiles = pieces_apart(0);
  for (FrameIndex& frame : tiles.back().frames) frame.value += 200;  // that no other tile has
  const std::vector<Similarity> moves = assemble_tiles(tiles);
  for (const Pose& pose : tiles.back().poses)
    EXPECT_LE((moves.back()(pose.centre) - pose.centre).norm(), 1e-9 * pose.centre.norm());
  tiles.pop_back();
  EXPECT_LE(largest_bend(tiles, moves), 1e-6);
}

TEST(TileAssembly, EmptyTilesAndPosesThatAreNoNumbersSayNothing) {
  std::vector<AlignmentTile> tiles = pieces_apart(0);
  tiles.insert(tiles.begin() + 1, AlignmentTile());
  tiles[2].poses[3].centre.x() = std::numeric_limits<double>::quiet_NaN();
  tiles[3].poses[5].rotation.w() = std::numeric_limits<double>::infinity();
  std::vector<Similarity> moves = assemble_tiles(tiles);
  EXPECT_EQ(moves[1].scale, 1);
  tiles.erase(tiles.begin() + 1);
  moves.erase(moves.begin() + 1);
  EXPECT_LE(largest_bend(tiles, moves, {3, 5}), 1e-6);
  EXPECT_TRUE(assemble_tiles({}).empty());
}

}  // namespace
}  // namespace megablock
