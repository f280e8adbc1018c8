// Builds the problem of a tile from the block: its tables of images, frames, cameras and mounts, and one row for each
// observation that the tile owns.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "adjust/problem/tile_problem.h"

namespace megablock {

// Builds the problem of a tile: all rows of `owned` (the track file of the tile) whose images belong to oriented
// frames, and the control points, priors and relative poses that the tile owns. The priors of a frame belong to the
// tile of the frame, the prior of a camera to the tile of the first oriented image that uses it, that of a receiver to
// the tile of the first oriented frame that it observes, and a relative pose to the tile that would own a track of its
// two frames. Every observation starts as kept. Observations of images without pose are not kept, but their rows stay,
// so that rows correspond to the track file. The image observations of control points follow them.
TileProblem make_tile_problem(const Block& block, const BlockState& state, const Tiles& tiles, TileIndex tile,
                              const TrackSet& owned, const ObservationOptions& options);

// The rows of the block's tables that belong to each tile, found for all tiles at the same time. A tile then reads its
// own rows alone, however large the block is.
struct RowsOfTile {
  std::vector<FrameIndex> frames;           // oriented frames with a prior of any kind, ascending
  std::vector<std::size_t> relative_poses;  // relative poses that the tile owns, between oriented frames, ascending
  // By the key of their type: rows that the tile owns, between oriented frames of one part of the block, ascending.
  std::map<std::string, std::vector<std::size_t>> measured;
  std::vector<std::size_t> verticals;  // of oriented images, ascending
  std::vector<CameraIndex> cameras;    // cameras whose first oriented image lies in the tile, ascending
  std::vector<MountId> mounts;         // mounts and receivers, in the same way
};
using RowsOfTiles = std::vector<RowsOfTile>;  // [tiles]
RowsOfTiles rows_of_tiles(const Block& block, const BlockState& state, const Tiles& tiles);
// The same problem. `rows` are those of the tile, from the same block, state and tiles.
TileProblem make_tile_problem(const Block& block, const BlockState& state, const Tiles& tiles, TileIndex tile,
                              const TrackSet& owned, const ObservationOptions& options, const RowsOfTile& rows);

}  // namespace megablock
