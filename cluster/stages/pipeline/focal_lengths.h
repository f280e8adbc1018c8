// Runs the stage of focal lengths. It makes focal_lengths/<camera>.txt: the focal length of a camera with
// `calibrate: auto`, estimated from the matches of some pairs of its images (match/verification/focal_length.h).
//
// Pairs of planes agree with every focal length, but a block of them does not. So a wrong focal length may pass this
// stage and be found when the block is oriented. Pairs were then lost or turned by it. The file of the camera keeps the
// better focal length, and the run begins again with it.
#pragma once

#include <string>

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

// Collective. Keeps the focal length that the oriented block gives a camera, for this run's second beginning and all
// later runs. Returns false, and keeps nothing, where the stage did not ask for the camera or has kept one before: a
// run begins again once at most for each camera.
bool keep_focal_length(const Stage& stage, const Job& job, CameraIndex camera, double focal_px, double sigma_px);

// "640 px (29 mm of the 35 mm format)".
std::string focal_length_text(const Camera& camera, double focal_px);

}  // namespace megablock
