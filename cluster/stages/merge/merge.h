// Runs the stage of the merge, which adjusts all tiles together, exactly, and makes the result of the job.
#pragma once

#include <string>
#include <vector>

#include "cluster/job/job.h"
#include "cluster/job/job_record.h"
#include "cluster/job/stage.h"
#include "cluster/stages/pipeline/orientation.h"
#include "io/block/image_graph.h"

namespace megablock {

// Makes merge/..., result/block.h5 and result/report.html. `own`, the block of the job, must not be used afterwards.
void run_merge(const Stage& stage, const Job& job, JobRecord& record, JobBlock& own, OrientationStage oriented,
               const Tiles& tiles, const std::vector<std::string>& tracks, const std::vector<std::string>& adjusted);

}  // namespace megablock
