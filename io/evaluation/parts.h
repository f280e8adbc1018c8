// Finds the parts of a block that common points or relative poses connect.
#pragma once

#include "io/evaluation/figures.h"

namespace megablock::report {

// Fills in Figures::parts and Figures::part_of_frame.
void find_parts(const BlockResult& result, const TrackBatches& tracks, Figures& figures);

}  // namespace megablock::report
