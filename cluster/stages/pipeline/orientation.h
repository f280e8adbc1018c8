// The stage of orientation: orient/<generation>.h5, initial poses of all frames.
#pragma once

#include <string>
#include <vector>

#include "cluster/job/job.h"

namespace megablock {

// Initial orientation: orient/<generation>.h5. Returns the block's state.
BlockState run_orientation(Job& job, const std::vector<std::string>& matches);

}  // namespace megablock
