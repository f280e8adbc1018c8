// The result of a job from its merged tiles.
#pragma once

#include <vector>

#include "cluster/job/job.h"
#include "cluster/stages/merge/merge_outcome.h"
#include "io/result/result.h"

namespace megablock {

// Everything of the result but its tracks and digest. `parts`: of all tiles. Takes over the job's block, which is empty
// afterwards, and the outcome: of a million images there should not be two.
BlockResult assemble_result(Job& job, const Tiles& tiles, MergeOutcome outcome, const std::vector<TilePart>& parts);

}  // namespace megablock
