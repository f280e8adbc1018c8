// Adds the problem of a tile to a fingerprint: everything that can influence its adjustment, and nothing else.
#pragma once

#include "adjust/problem/tile_problem.h"
#include "io/base/hash.h"

namespace megablock {

// Leaves out the indices of points in the block. The adjustment does not use them, and they may change when the block
// grows.
void add_to_hash(Hasher& hasher, const TileProblem& problem, const TileState& start);

}  // namespace megablock
