// Runs the stage of candidate pairs. It makes graph.h5.
#pragma once

#include "cluster/job/job.h"
#include "cluster/job/job_record.h"
#include "cluster/job/stage.h"
#include "cluster/stages/pipeline/features.h"
#include "io/block/image_graph.h"

namespace megablock {

// Collective.
CandidateGraph run_candidates(const Stage& stage, const Job& job, JobRecord& record, const FeatureStage& features);

}  // namespace megablock
