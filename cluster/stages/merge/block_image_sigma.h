// The sigma of tie point measurements (adjust/tile/image_sigma.h) of the whole block: all tiles are adjusted with the
// same.
#pragma once

#include <string>
#include <vector>

#include "cluster/job/job.h"
#include "merge/tree/merge_tree_runner.h"

namespace megablock {

// Before the block is adjusted: the root mean square of the tiles' own estimates, by kept observations.
double start_image_sigma(const Job& job, const std::vector<std::string>& adjusted);

// At a solution, collective: the block's estimate, given to this rank's tiles when it differs enough from theirs to be
// worth another adjustment. The same answer on every rank. `oriented`: which frames are unknowns.
bool adopt_image_sigma(Job& job, TileStore& own, std::size_t tile_count, const BlockState& oriented);

// Collective: what the tiles were adjusted with, on ranks without tiles too.
double common_image_sigma(Job& job, const TileStore& own);

}  // namespace megablock
