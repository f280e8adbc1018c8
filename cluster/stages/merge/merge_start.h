// Forms the start of the global adjustment from the adjustments of the single tiles.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "adjust/checks/prior_test.h"
#include "adjust/problem/frame_motion.h"
#include "adjust/problem/tile_problem.h"
#include "adjust/terms/build_problem.h"
#include "cluster/job/job.h"
#include "geometry/similarity/similarity.h"
#include "io/block/image_graph.h"
#include "io/block/tracks.h"

namespace megablock {

// A tile in the merge.
struct MergeTile {
  TileIndex tile;
  TrackSet tracks;
  TileProblem problem;
  TileState state;
};

// Joins the adjustments of the tiles. Tiles without a common datum (no position priors, fewer than three control
// points) are first assembled (merge/start/tile_assembly.h). All tiles are then aligned jointly
// (merge/start/tile_alignment.h). A frame takes its pose from the tile with most of its observations, or from the lower
// tile when the numbers are equal. Stretches of frames that contradict their relative poses are turned back
// (adjust/orientation/turned_stretches.h). Intrinsics and free mounts are means over the tiles, weighted by
// observations. Frames that no adjusted tile holds lose their orientation.
struct MergeStart {
  BlockState state;
  // [tiles] motions that aligned the tiles; empty when the merge starts from a checkpoint
  std::vector<Similarity> motions;
  IndexedVector<FrameIndex, TileIndex>
      tile_of_frame;  // the tile whose motion moved the frame; invalid when more than this motion did
  std::optional<FramePaths> paths = {};  // of blocks with rolling shutters
  std::vector<PriorId> aside = {};       // control points that took no part in the adjustments of the tiles
};
MergeStart merge_start(const Job& job, const BlockState& oriented, const std::vector<std::string>& adjusted);

// The tracks of a tile, split into the parts that its adjustment found. They are not split when `adjusted` is empty.
TrackSet read_split_tracks(const Job& job, const std::string& tracks, const std::string& adjusted);

// The problem of a tile with the kept flags of its adjustment. Its points move with the tile. A point is intersected
// again when not all of its frames have moved with the tile, or when its cameras are means of several tiles. The points
// of a checkpoint replace them. `oriented` is a state that stays the same when the merge is resumed.
MergeTile load_merge_tile(const Job& job, const BlockState& oriented, const MergeStart& start, const Tiles& tiles,
                          TileIndex tile, const RowsOfTile& rows, const std::string& tracks,
                          const std::string& adjusted);

}  // namespace megablock
