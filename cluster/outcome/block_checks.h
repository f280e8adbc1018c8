// What a job's poses and points say of themselves, with nothing to compare them with (KP-12, KP-14, KP-17):
//
// * flight lines: whether exposures stand on a line at even distances, as those of one overpass of a satellite do;
// * ground: whether the tie points of a block that looks down lie on two levels, as they do where parts of a block
// whose
//   ground is flat disagree;
// * point subsets: how far disjoint subsets of the tie points disagree in the attitudes, and the sigma of what they
//   share; of results whose datum is not free, up to 200 frames and 200 000 measurements;
// * common tracks: subsets of images that are asked for, by the tie points that all of their images share.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "adjust/checks/sanity_checks.h"
#include "adjust/checks/subset_check.h"
#include "io/block/block.h"
#include "io/store/job/job_store.h"
#include "match/tracks/common_tracks.h"

namespace megablock {

struct BlockChecks {
  struct Line {
    FrameIndex first, last;
    std::int64_t exposures = 0;
    StripCheck check;
  };
  std::vector<Line> lines;  // of blocks that look down, as they were flown
  std::optional<LevelCheck> level;
  std::optional<SubsetCheck> subsets;
  std::string no_subsets;  // why not
  std::vector<ImageSubset> common;
};

// Of the result, else of what there is before. `aerial`: it looks down (BlockDiagnostics); `subsets`: names of images.
// Throws InputError for names that the block does not have.
BlockChecks check_job(const JobStore& store, bool aerial, const std::vector<std::vector<std::string>>& subsets);

// A JSON object (docs/reference/file-formats.md, "Diagnostics").
std::string to_json(const BlockChecks& checks, const Block& block);
// A line for each check.
std::string to_text(const BlockChecks& checks, const Block& block);

}  // namespace megablock
