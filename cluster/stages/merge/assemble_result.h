// Assembles the result of a job from its merged tiles.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "cluster/job/job.h"
#include "cluster/job/job_record.h"
#include "cluster/stages/merge/merge_outcome.h"
#include "io/result/result.h"

namespace megablock {

// The result without its tracks and digest. `block` is the block of the job. It and the outcome are empty afterwards,
// so that a block of a million images is not in memory twice. `not_oriented`: reasons by frame. `parts`: of all tiles.
BlockResult assemble_result(const Job& job, const JobRecord& record, Block& block, const Tiles& tiles,
                            const std::map<FrameIndex, std::string>& not_oriented, MergeOutcome outcome,
                            const std::vector<TilePart>& parts);

}  // namespace megablock
