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

// Poses from the tile that holds most of a frame's observations (ties: lower tile), intrinsics as means over the tiles
// weighted by observations; frames that no adjusted tile holds lose their orientation. Without a datum (no position
// priors) the tiles are first brought onto the initial orientation by similarities.
BlockState merge_start(const Job& job, const BlockState& oriented, const std::vector<std::string>& adjusted);

// A tile's problem with the kept flags of its adjustment, its points re-triangulated in `state`.
MergeTile load_merge_tile(const Job& job, const BlockState& state, const Tiles& tiles, TileIndex tile,
                          const std::string& tracks, const std::string& adjusted);

}  // namespace megablock
