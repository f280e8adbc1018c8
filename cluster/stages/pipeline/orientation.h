// Runs the stage of orientation. It makes orient/<generation>.h5, initial poses of all frames.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "cluster/job/job.h"
#include "cluster/job/job_record.h"
#include "cluster/job/stage.h"

namespace megablock {

struct OrientationStage {
  BlockState state;
  std::map<FrameIndex, std::string> not_oriented;  // frames without a pose, and why
  bool only_turned = false;                        // nearly all pairs of images show no parallax
};

// Collective. `own` is the job's block. Verticals that are set aside leave it, and so do positions with east and north
// exchanged; such control becomes check points (mirrored_lists.h). Positions that lie off the control or off each other
// get a shift (position_offset.h, position_shifts.h).
OrientationStage run_orientation(const Stage& stage, const Job& job, JobRecord& record,
                                 const std::vector<std::string>& matches, Block& own);

// The message for a block of which no image could be oriented: the likely cause and the remedy. `only_turned`: that of
// OrientationStage.
std::string why_nothing_is_oriented(const Block& block, bool only_turned);

}  // namespace megablock
