// Finds the parts of a block that common points or relative poses connect.
#pragma once

#include "io/evaluation/figures.h"

namespace megablock::report {

// Fills in Figures::parts and Figures::part_of_frame. A part is a component of the graph whose nodes are the oriented
// frames; common kept observations of a point and relative poses are its edges. Only within a part do observations tie
// coordinates to each other.
void find_parts(const BlockResult& result, const TrackBatches& tracks, Figures& figures);

}  // namespace megablock::report
