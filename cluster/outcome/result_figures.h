// What 'status' says of a result: written beside it, as finding it anew goes through all of its tracks.
#pragma once

#include <string>
#include <vector>

#include "io/result/result.h"
#include "io/store/job/job_store.h"

namespace megablock {

inline constexpr const char* kResultFigures = "result/figures.json";

// What takes passes through the tracks.
struct ResultFigures {
  ReprojectionStatistics statistics;
  std::vector<std::string> remarks;
};

// One JSON object; keys as in 'status --json', `failures` with the images that got no pose.
std::string to_json(const ResultFigures& figures, const BlockResult& result);

// Of the job's result, which is there: as they were written with it, else found anew.
std::string result_figures(const JobStore& store);

// The remarks among them: what a reader must not overlook. None without a result.
std::vector<std::string> result_remarks(const JobStore& store);
// A line "  look: ..." each, wherever they are printed.
std::string look_text(const std::vector<std::string>& remarks);

}  // namespace megablock
