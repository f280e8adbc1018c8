// The stage of orientation. It makes orient/<generation>.h5, initial poses of all frames.
#pragma once

#include <string>
#include <vector>

#include "cluster/job/job.h"
#include "cluster/job/stage.h"

namespace megablock {

// Collective. Returns the state of the block.
BlockState run_orientation(const Stage& stage, Job& job, const std::vector<std::string>& matches);

}  // namespace megablock
