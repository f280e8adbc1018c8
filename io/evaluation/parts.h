// Parts of a block that hang together by common points or relative poses.
#pragma once

#include "io/evaluation/figures.h"

namespace megablock::report {

// Fills in parts and part_of_frame.
void find_parts(const BlockResult& result, const TrackBatches& tracks, Figures& figures);

}  // namespace megablock::report
