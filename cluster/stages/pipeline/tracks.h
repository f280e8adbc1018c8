// Runs the stage of tracks. It makes tracks/<tile>.h5, the tie points that each tile owns.
#pragma once

#include <string>
#include <vector>

#include "cluster/job/job.h"
#include "cluster/job/job_record.h"
#include "cluster/job/stage.h"
#include "io/block/image_graph.h"

namespace megablock {

// Collective. Returns the unit names by tile. The id of a track is its first image times 2^24 plus the feature. It
// stays the same when the block grows; the result has dense indices.
std::vector<std::string> run_tracks(const Stage& stage, const Job& job, JobRecord& record,
                                    const std::vector<std::string>& matches, const Tiles& tiles);
std::vector<std::string> run_given_tracks(const Stage& stage, const Job& job, JobRecord& record,
                                          const std::string& tie_points, const Tiles& tiles);

// Collective. Brings the index of the measurement store (io/result/measurements.h) up to date with the tracks.
void index_measurements(const Job& job, const std::vector<std::string>& tracks);

}  // namespace megablock
