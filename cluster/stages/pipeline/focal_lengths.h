// Runs the stage of focal lengths. It makes focal_lengths/<camera>.txt: the focal length of a camera with
// `calibrate: auto`, estimated from the matches of some pairs of its images (match/verification/focal_length.h).
#pragma once

#include "cluster/job/job.h"
#include "cluster/job/job_record.h"
#include "cluster/job/stage.h"
#include "cluster/stages/pipeline/features.h"
#include "io/block/image_graph.h"

namespace megablock {

// Collective. Sets the start value of the focal length of the cameras of `block` (that of the job) where it is a guess,
// or where the images contradict it clearly, and notes it. Does nothing where no camera asks for it.
void run_focal_lengths(const Stage& stage, const Job& job, JobRecord& record, const FeatureStage& features,
                       const CandidateGraph& graph, Block& block);

}  // namespace megablock
