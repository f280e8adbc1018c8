// Tiles without a common datum, as independent models (M51, M52): each was adjusted in a frame of its own, and all come
// into one.
//
// Tiles share frames. They are joined by the similarities between these (adjust/model_assembly.h), and each part that
// hangs together is brought onto the initial orientation as a whole: so it bends as little as its tiles do, where each
// tile on its own would follow the bends of the initial orientation.
#pragma once

#include <vector>

#include "io/index.h"
#include "merge/tile_alignment.h"

namespace megablock {

// One similarity per tile, applied as S(pose). A tile that nothing joins, or that does not fit its neighbours, is
// brought onto the initial orientation on its own; identity where even that is impossible.
std::vector<Similarity> assemble_tiles(const std::vector<AlignmentTile>& tiles,
                                       const IndexedVector<FrameIndex, Pose>& oriented);

}  // namespace megablock
