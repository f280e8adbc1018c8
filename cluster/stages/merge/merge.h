// The stage of the merge: the exact adjustment of all tiles together, and the result of the job.
#pragma once

#include <string>
#include <vector>

#include "cluster/job/job.h"
#include "io/block/image_graph.h"

namespace megablock {

// Merge and result: merge/..., result/block.h5, result/report.html. The job's block is not to be used afterwards.
void run_merge(Job& job, BlockState oriented, const Tiles& tiles, const std::vector<std::string>& tracks,
               const std::vector<std::string>& adjusted);

}  // namespace megablock
