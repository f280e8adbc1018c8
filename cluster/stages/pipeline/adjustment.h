// Runs the stage of adjustment. It makes adjust/<tile>.h5, the adjustment of each tile on its own.
#pragma once

#include <string>
#include <vector>

#include "cluster/job/job.h"
#include "cluster/job/job_record.h"
#include "cluster/job/stage.h"
#include "io/block/image_graph.h"

namespace megablock {

// Collective. Returns the unit names by tile; empty for tiles that could not be adjusted.
std::vector<std::string> run_adjustment(const Stage& stage, const Job& job, JobRecord& record,
                                        const BlockState& oriented, const Tiles& tiles,
                                        const std::vector<std::string>& tracks);

}  // namespace megablock
