#include "cluster/job/job_so_far.h"

#include <algorithm>
#include <optional>

#include "cluster/job/stage.h"
#include "io/base/error.h"
#include "io/store/units/block_file.h"
#include "io/store/units/state_file.h"
#include "io/store/units/tracks_file.h"
#include "partition/diagnostics/block_diagnostics.h"

namespace megablock {

namespace {

// The orientation of the last generation, if it was made from the present block.
std::optional<BlockState> oriented_state(const JobStore& store, const Block& block) {
  std::vector<std::string> units = store.list(find_stage(kOrientationStage)->folder());
  std::sort(units.begin(), units.end());
  if (units.empty()) return std::nullopt;
  BlockState state = read_orientation(store.verified_path(units.back())).state;
  return state.frames.size() == block.frames.size() ? std::optional(std::move(state)) : std::nullopt;
}

}  // namespace

JobSoFar read_job_so_far(const JobStore& store) {
  if (!store.seal("block.h5")) throw InputError(store.directory() + ": the job holds no block yet; run it first");
  JobSoFar job{read_block(store.verified_path("block.h5")), {}, "the given poses"};
  job.state = state_of_priors(job.block);
  if (auto oriented = oriented_state(store, job.block)) {
    job.state = std::move(*oriented);
    job.source = "the initial orientation";
  }
  return job;
}

void visit_tracks(const JobStore& store, const std::function<void(TrackSet&&)>& take) {
  std::vector<std::string> units = store.list(find_stage(kTrackStage)->folder());
  std::sort(units.begin(), units.end());
  for (const std::string& unit : units)
    if (unit.ends_with(".h5")) take(read_tracks(store.verified_path(unit)));
}

}  // namespace megablock
