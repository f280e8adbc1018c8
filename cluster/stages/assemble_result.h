// The result of a job from its merged tiles.
#pragma once

#include <vector>

#include "cluster/job.h"
#include "cluster/stages/merge_outcome.h"
#include "io/result.h"

namespace megablock {

// Everything of the result but its tracks and digest. `parts`: of all tiles.
BlockResult assemble_result(const Job& job, const Tiles& tiles, const MergeOutcome& outcome,
                            const std::vector<TilePart>& parts);

}  // namespace megablock
