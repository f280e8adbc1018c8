// Assembles the result of a job from its merged tiles.
#pragma once

#include <vector>

#include "cluster/job/job.h"
#include "cluster/stages/merge/merge_outcome.h"
#include "io/result/result.h"

namespace megablock {

// The result without its tracks and digest. `parts` are those of all tiles. It takes over the outcome and the block of
// the job, which is empty afterwards, so that a block of a million images is not in memory twice.
BlockResult assemble_result(Job& job, const Tiles& tiles, MergeOutcome outcome, const std::vector<TilePart>& parts);

}  // namespace megablock
