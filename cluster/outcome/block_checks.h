// Checks the poses and points of a job without external data (Barrier and Martin):
//
//  * flight lines: whether the projection centres of a strip lie on a line at even distances, as those of one overpass
//    of a satellite do;
//  * ground: whether the tie points of a block that looks down lie on two levels, a sign that parts of a block over
//    flat ground disagree;
//  * point subsets: how far the attitudes from disjoint subsets of the tie points differ, and the sigma of their common
//    error; for results with a fixed datum, up to 200 frames and 200 000 observations;
//  * common tracks: the number of tie points that all images of given subsets share.
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
  std::vector<Line> lines;  // of blocks that look down, in the order of the flight
  std::optional<LevelCheck> level;
  std::optional<SubsetCheck> subsets;
  std::string no_subsets;  // why the check of subsets was not made
  std::vector<ImageSubset> common;
};

// Checks the result of a job, or its poses before there is a result. `aerial`: the block looks down (BlockDiagnostics).
// `subsets`: names of images. Throws InputError for names that the block does not have.
BlockChecks check_job(const JobStore& store, bool aerial, const std::vector<std::vector<std::string>>& subsets);

// A JSON object (docs/reference/file-formats.md, "Diagnostics").
std::string to_json(const BlockChecks& checks, const Block& block);
// One line for each check.
std::string to_text(const BlockChecks& checks, const Block& block);

}  // namespace megablock
