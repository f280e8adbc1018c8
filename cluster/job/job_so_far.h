// Reads the block, the poses and the tracks of a job that has no result yet.
#pragma once

#include <functional>
#include <string>

#include "io/block/block.h"
#include "io/block/tracks.h"
#include "io/store/job/job_store.h"

namespace megablock {

struct JobSoFar {
  Block block;
  BlockState state;
  // The origin of the poses: "the initial orientation", "the given poses" (or position and attitude priors).
  std::string source;
};
// Throws InputError for a job without a block.
JobSoFar read_job_so_far(const JobStore& store);

// Calls `take` with the tracks of each tile in turn, as far as the job has tracks.
void visit_tracks(const JobStore& store, const std::function<void(TrackSet&&)>& take);

}  // namespace megablock
