// Runs the stage of cameras. It makes cameras/<rig>.txt: which parameters of the cameras with `calibrate: auto` are
// estimated, chosen from a sample of the oriented block (merge/camera/determined_parameters.h).
#pragma once

#include <string>
#include <vector>

#include "cluster/job/job.h"
#include "cluster/job/job_record.h"
#include "cluster/job/stage.h"
#include "io/block/image_graph.h"

namespace megablock {

// The focal length of a camera that the oriented block found, where it was matched with a wrong one.
struct BetterFocalLength {
  CameraIndex camera;
  double focal_px = 0, sigma_px = 0;
};

struct CameraFindings {
  std::vector<BetterFocalLength> better;    // differ from those of the matching by more than a tenth
  std::vector<std::string> contradictions;  // of stated focal lengths, as notes; not for a run that begins again
};

// Collective. Sets the prior sigmas of the cameras of `block` (that of the job) by the choice, and puts held parameters
// of the state back to their start values. Does nothing where no camera asks for it.
CameraFindings run_cameras(const Stage& stage, const Job& job, JobRecord& record, const Tiles& tiles, BlockState& state,
                           Block& block);

}  // namespace megablock
