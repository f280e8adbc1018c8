// Runs the stage of tiles. It makes tiles.h5, the tiles of the block and the merge tree.
#pragma once

#include <string>
#include <vector>

#include "cluster/job/job.h"
#include "cluster/job/job_record.h"
#include "cluster/job/stage.h"
#include "io/block/image_graph.h"

namespace megablock {

// Collective. Works from verified matches, or from given tracks.
Tiles run_tiles(const Stage& stage, const Job& job, JobRecord& record, const std::vector<std::string>& matches);
Tiles run_tiles_of_tracks(const Stage& stage, const Job& job, JobRecord& record, const std::string& tie_points);

}  // namespace megablock
