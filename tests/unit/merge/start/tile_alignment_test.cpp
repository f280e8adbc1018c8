// Pieces of a known block, each moved by a similarity of its own, come together again.
#include "merge/start/tile_alignment.h"

#include <gtest/gtest.h>

#include "tests/support/merge/moved_pieces.h"

namespace megablock {
namespace {

using namespace moved_pieces;

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
