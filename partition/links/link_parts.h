// Parts of a block that hang together by good links, and the links that alone hold two parts together.
#pragma once

#include "io/block/block_diagnostics.h"
#include "partition/links/link_weights.h"

namespace megablock {

// Fills in part_of_frame, part_frames, weak_links and single_links, of frames with a pose. Linear in the links.
void find_link_parts(const Block& block, const BlockState& state, const LinkWeights& links,
                     BlockDiagnostics& diagnostics);

}  // namespace megablock
