// Runs the stage of false pairs. It makes false_pairs/<cell>.h5: the matches of a cell without the pairs of images that
// show different things which look alike (match/verification/false_pairs.h).
#pragma once

#include <string>
#include <vector>

#include "cluster/job/job.h"
#include "cluster/job/job_record.h"
#include "cluster/job/stage.h"

namespace megablock {

// Blocks of more images are left as they are: they come from flights or vehicles, and every rank would hold all
// matches.
inline constexpr std::int64_t kMostJudgedImages = 3000;

// Collective. `matches` are the units of the stage of matching. Returns them with those of this stage in place of the
// cells that hold false pairs, and notes what was left out. Does nothing unless lacks_positions().
std::vector<std::string> run_false_pairs(const Stage& stage, const Job& job, JobRecord& record,
                                         const std::vector<std::string>& matches);

// Whether fewer than half of the frames have an observed position or a given pose. Others tell apart what looks alike,
// and hold the block together.
bool lacks_positions(const Block& block);

}  // namespace megablock
