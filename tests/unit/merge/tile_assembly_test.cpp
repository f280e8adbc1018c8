// Pieces of a known block, each in a frame of its own, in one frame again; the initial orientation bends.
#include "merge/tile_assembly.h"

#include <gtest/gtest.h>

#include "tests/unit/merge/moved_pieces.h"

namespace megablock {
namespace {

using namespace moved_pieces;

constexpr double kBend = 8;  // m, the largest error of the initial orientation

Pose bent_pose(std::int64_t frame) {
  Pose pose = true_pose(frame);
  const double along = static_cast<double>(frame) / (kTiles * (kFrames - kCommon));
  pose.centre.y() += kBend * std::sin(6 * along);
  pose.centre.z() -= kBend * along * along;
  return pose;
}

IndexedVector<FrameIndex, Pose> bent_orientation() {
  IndexedVector<FrameIndex, Pose> poses;
  for (std::int64_t f = 0; f < 400; ++f) poses.push_back(bent_pose(f));
  return poses;
}

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

TEST(TileAssembly, ExactPiecesDoNotFollowTheBendsOfTheInitialOrientation) {
  const std::vector<AlignmentTile> tiles = pieces_apart(0);
  const std::vector<Similarity> moves = assemble_tiles(tiles, bent_orientation());
  EXPECT_LE(largest_gap(tiles, moves), 1e-6);
  EXPECT_LE(largest_bend(tiles, moves), 1e-6);
  // In the initial orientation as a whole: nothing is farther from it than it bends.
  for (std::size_t t = 0; t < tiles.size(); ++t)
    for (std::size_t i = 0; i < tiles[t].poses.size(); ++i)
      EXPECT_LE((moves[t](tiles[t].poses[i].centre) - bent_pose(tiles[t].frames[i].value).centre).norm(), 2 * kBend);
}

TEST(TileAssembly, BendsByTheNoiseOfItsTiles) {
  const std::vector<AlignmentTile> tiles = pieces_apart(0.02);
  const std::vector<Similarity> moves = assemble_tiles(tiles, bent_orientation());
  EXPECT_LE(largest_gap(tiles, moves), 0.25);
  EXPECT_LE(largest_bend(tiles, moves), 0.05 * kBend);
}

TEST(TileAssembly, FramesThatHaveMovedDoNotBendIt) {
  const std::vector<AlignmentTile> tiles = pieces_apart(0.01);
  std::vector<AlignmentTile> wrong = tiles;
  for (AlignmentTile& tile : wrong) {
    const double size = (tile.poses[20].centre - tile.poses[0].centre).norm() / 100;
    tile.poses[2].centre += size * Eigen::Vector3d(15, -8, 20);
    tile.poses[4].centre += size * Eigen::Vector3d(-300, 0, 100);
    tile.observations[4] = 7;  // too few to be heard
  }
  EXPECT_LE(largest_bend(wrong, assemble_tiles(wrong, bent_orientation()), {2, 4}), 0.05 * kBend);
}

TEST(TileAssembly, APieceThatSharesNothingGoesOntoTheInitialOrientation) {
  std::vector<AlignmentTile> tiles = pieces_apart(0);
  AlignmentTile& alone = tiles.back();
  Similarity moved;
  moved.scale = 3;
  moved.translation = {500, -200, 30};
  for (std::size_t i = 0; i < alone.frames.size(); ++i) {
    alone.frames[i].value += 200;  // that no other tile has
    alone.poses[i] = moved(bent_pose(alone.frames[i].value));
  }
  const std::vector<Similarity> moves = assemble_tiles(tiles, bent_orientation());
  for (std::size_t i = 0; i < alone.frames.size(); ++i)
    EXPECT_LE((moves.back()(alone.poses[i].centre) - bent_pose(alone.frames[i].value).centre).norm(), 1e-6);
  tiles.pop_back();
  EXPECT_LE(largest_bend(tiles, moves), 1e-6);
}

TEST(TileAssembly, TilesWithoutFramesStayWhereTheyAre) {
  std::vector<AlignmentTile> tiles = pieces_apart(0);
  tiles.insert(tiles.begin() + 1, AlignmentTile());
  const std::vector<Similarity> moves = assemble_tiles(tiles, bent_orientation());
  EXPECT_EQ(moves[1].scale, 1);
  tiles.erase(tiles.begin() + 1);
  std::vector<Similarity> others = moves;
  others.erase(others.begin() + 1);
  EXPECT_LE(largest_bend(tiles, others), 1e-6);
}

}  // namespace
}  // namespace megablock
