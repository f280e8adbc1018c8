// From the tiles' own adjustments to one start of the global adjustment, and from its end to the result.
#pragma once

#include <string>
#include <vector>

#include "adjust/tile_problem.h"
#include "cluster/job.h"
#include "io/image_graph.h"
#include "io/tracks.h"
#include "io/unit_files.h"

namespace megablock {

// One tile as the merge works on it.
struct MergeTile {
  TileIndex tile;
  TrackSet tracks;
  TileProblem problem;
  TileState state;
};

// The tiles' adjustments put together: without a datum (no position priors) each tile is first brought onto the initial
// orientation; then all are aligned jointly (merge/tile_alignment.h), a frame takes its pose from the tile that holds
// most of its observations (ties: lower tile), stretches that contradict their relative poses are turned back
// (adjust/turned_stretches.h), intrinsics and free mounts are means over the tiles weighted by
// observations. Frames that no adjusted tile holds lose their orientation.
BlockState merge_start(const Job& job, const BlockState& oriented, const std::vector<std::string>& adjusted);

// The tracks of a tile, split into the parts that its adjustment found. `adjusted` empty: as they are.
TrackSet read_split_tracks(const Job& job, const std::string& tracks, const std::string& adjusted);

// A tile's problem with the kept flags of its adjustment, its points re-triangulated in `state`.
MergeTile load_merge_tile(const Job& job, const BlockState& state, const Tiles& tiles, TileIndex tile,
                          const std::string& tracks, const std::string& adjusted);

}  // namespace megablock
