// Finds the parts of a block that good links join, and the single links on which the connection of two parts depends.
#pragma once

#include "io/block/block_diagnostics.h"
#include "partition/links/link_weights.h"

namespace megablock {

// Fills in part_of_frame, part_frames, weak_links and single_links of the diagnostics, for frames with a pose. The time
// is linear in the number of links.
void find_link_parts(const Block& block, const BlockState& state, const LinkWeights& links,
                     BlockDiagnostics& diagnostics);

}  // namespace megablock
