// Builds the problem of a tile from the block: its tables of images, frames, cameras and mounts, and one row for each
// observation that the tile owns.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "adjust/problem/tile_problem.h"

namespace megablock {

// Builds a tile's problem: all rows of `owned` (the tile's track file) whose images belong to oriented frames, the
// control points, priors and relative poses that the tile owns (a frame's priors: the frame's tile; a camera's prior:
// the tile of the first oriented image that uses it; a relative pose: as a track of its two frames).
// Every observation starts kept. Observations of images without pose are left out of `kept` (0), not out of the rows,
// so that rows stay aligned with the track file; then the control points' measurements follow.
TileProblem make_tile_problem(const Block& block, const BlockState& state, const Tiles& tiles, TileIndex tile,
                              const TrackSet& owned, const ObservationOptions& options);

// What the block's tables hold of each tile, found in one pass over them for all tiles: a tile then asks for its own
// rows alone, however large the block is.
struct RowsOfTile {
  std::vector<FrameIndex> frames;           // oriented and with a prior of any kind, ascending
  std::vector<std::size_t> relative_poses;  // that the tile owns, between oriented frames, ascending
  // By the key of their type; that the tile owns, between oriented frames of one part of the block, ascending.
  std::map<std::string, std::vector<std::size_t>> measured;
  std::vector<std::size_t> verticals;  // of oriented images, ascending
  std::vector<CameraIndex> cameras;    // whose first oriented image lies in the tile, ascending
  std::vector<MountId> mounts;         // the same
};
using RowsOfTiles = std::vector<RowsOfTile>;  // [tiles]
RowsOfTiles rows_of_tiles(const Block& block, const BlockState& state, const Tiles& tiles);
// The same problem; `rows` of the tile, by the same block, state and tiles.
TileProblem make_tile_problem(const Block& block, const BlockState& state, const Tiles& tiles, TileIndex tile,
                              const TrackSet& owned, const ObservationOptions& options, const RowsOfTile& rows);

}  // namespace megablock
