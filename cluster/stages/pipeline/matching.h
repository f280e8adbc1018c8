// Runs the stage of matching. It makes matches/<cell>.h5, the verified matches of the pairs of a cell.
#pragma once

#include <string>
#include <vector>

#include "cluster/job/job.h"
#include "cluster/job/job_record.h"
#include "cluster/job/stage.h"
#include "cluster/stages/pipeline/features.h"
#include "io/block/image_graph.h"

namespace megablock {

// Collective: all ranks call it together. Returns the unit names.
std::vector<std::string> run_matching(const Stage& stage, const Job& job, JobRecord& record,
                                      const FeatureStage& features, const CandidateGraph& graph);

}  // namespace megablock
