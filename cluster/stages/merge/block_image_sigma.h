// Gives the sigma of the tie point observations (adjust/tile/image_sigma.h). All tiles of a block are adjusted with the
// same value.
#pragma once

#include <string>
#include <vector>

#include "cluster/job/job.h"
#include "merge/tree/merge_tree_runner.h"

namespace megablock {

// The sigma before the adjustment of the block: the root mean square of the tiles' own estimates, weighted by kept
// observations.
double start_image_sigma(const Job& job, const std::vector<std::string>& adjusted);

// Collective, at a solution. Estimates the sigma of the block, and gives it to the tiles of this rank when it differs
// so much that another adjustment is worth while. The answer is the same on every rank. `oriented` tells which frames
// are unknowns.
bool adopt_image_sigma(const Job& job, TileStore& own, std::size_t tile_count, const BlockState& oriented);

// Collective. The sigma with which the tiles were adjusted, also on ranks without tiles.
double common_image_sigma(const Job& job, const TileStore& own);

}  // namespace megablock
