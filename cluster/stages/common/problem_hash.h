// A tile's problem in fingerprints: everything that can reach its adjustment and nothing else of the block.
#pragma once

#include "adjust/problem/tile_problem.h"
#include "io/base/hash.h"

namespace megablock {

// Without the points' places in the block, which the adjustment does not use and which may move when a block grows.
void add_to_hash(Hasher& hasher, const TileProblem& problem, const TileState& start);

}  // namespace megablock
