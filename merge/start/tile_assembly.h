// Tiles without a common datum, as independent models (M51, M52), brought into one frame.
//
// Each was adjusted with the datum of its start values alone, and neighbours differ in place, attitude and scale by
// what these are good for. What they share are frames: the similarities between these join them
// (adjust/models/model_assembly.h). Each part that hangs together is then brought back to where its tiles were, in the
// mean: its attitude by the turns that the assembly made,
//
//     R = mean R_t',     weighted by the frames of tile t,
//
// as centres on a line would leave it open, and its size and place by the centres.
#pragma once

#include <vector>

#include "merge/start/tile_alignment.h"

namespace megablock {

// One similarity per tile, applied as S(pose). Identity for a tile that nothing joins, or that does not fit its
// neighbours, and for all where the assembly fails.
std::vector<Similarity> assemble_tiles(const std::vector<AlignmentTile>& tiles);

}  // namespace megablock
