// Brings tiles without a common datum into one ground frame, as a block adjustment of independent models (Kalantari
// 2009).
//
// Each tile was adjusted with the datum of its start values alone. Neighbours therefore differ in place, attitude and
// scale by the errors of these values. The frames that tiles share give the similarities between the tiles
// (adjust/independent_models/model_assembly.h). Each connected part is then moved back to the mean place of its tiles.
// Its attitude follows from the rotations R_t of the assembly,
//
//     R = mean R_t',     weighted by the frames of tile t,
//
// because projection centres on a line would leave it undetermined. Its size and place follow from the projection
// centres.
// Internal to merge/: it is not installed.
#pragma once

#include <vector>

#include "merge/start/tile_alignment.h"

namespace megablock {

// Returns one similarity for each tile, applied as S(pose). It is the identity for a tile that shares no frames or does
// not fit its neighbours, and for all tiles when the assembly fails.
std::vector<Similarity> assemble_tiles(const std::vector<AlignmentTile>& tiles);

}  // namespace megablock
