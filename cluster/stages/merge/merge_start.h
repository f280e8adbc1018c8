// From the tiles' own adjustments to one start of the global adjustment, and from its end to the result.
#pragma once

#include <string>
#include <vector>

#include "adjust/problem/tile_problem.h"
#include "adjust/terms/build_problem.h"
#include "cluster/job/job.h"
#include "geometry/similarity/similarity.h"
#include "io/block/image_graph.h"
#include "io/block/tracks.h"

namespace megablock {

// One tile as the merge works on it.
struct MergeTile {
  TileIndex tile;
  TrackSet tracks;
  TileProblem problem;
  TileState state;
};

// The tiles' adjustments put together: without a common datum (no position priors, fewer than three control points)
// they are assembled first (merge/start/tile_assembly.h); then all are aligned jointly (merge/start/tile_alignment.h),
// a frame takes its pose from the tile that holds most of its observations (ties: lower tile), stretches that
// contradict their relative poses are turned back (adjust/orientation/turned_stretches.h), intrinsics and free mounts
// are means over the tiles weighted by observations. Frames that no adjusted tile holds lose their orientation.
struct MergeStart {
  BlockState state;
  std::vector<Similarity> motions;                     // [tiles] that aligned them; empty: of a checkpoint
  IndexedVector<FrameIndex, TileIndex> tile_of_frame;  // whose motion brought the frame here; invalid: more than that
};
MergeStart merge_start(const Job& job, const BlockState& oriented, const std::vector<std::string>& adjusted);

// The tracks of a tile, split into the parts that its adjustment found. `adjusted` empty: as they are.
TrackSet read_split_tracks(const Job& job, const std::string& tracks, const std::string& adjusted);

// A tile's problem with the kept flags of its adjustment. Its points go with the tile; those whose frames have not all
// done so, or whose cameras are the mean of several tiles', are triangulated anew. Of a checkpoint, which has points of
// its own, they are left as they were. `oriented`: what stays the same when the merge is resumed.
MergeTile load_merge_tile(const Job& job, const BlockState& oriented, const MergeStart& start, const Tiles& tiles,
                          TileIndex tile, const RowsOfTile& rows, const std::string& tracks,
                          const std::string& adjusted);

}  // namespace megablock
