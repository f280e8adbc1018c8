// Stores and reads the figures of a result for `status`. They are stored beside the result, because computing them
// reads all tracks.
#pragma once

#include <string>
#include <vector>

#include "io/result/result.h"
#include "io/store/job/job_store.h"

namespace megablock {

inline constexpr const char* kResultFigures = "result/figures.json";

// The figures for which all tracks are read.
struct ResultFigures {
  ReprojectionStatistics statistics;
  std::vector<std::string> remarks;
};

// One JSON object with the keys of 'status --json'; `failures` includes the images that got no pose.
std::string to_json(const ResultFigures& figures, const BlockResult& result);

// The figures of the result of a job, which exists. They are read from the store, or else computed again.
std::string result_figures(const JobStore& store);

// The remarks among the figures, which a reader must not overlook. None without a result.
std::vector<std::string> result_remarks(const JobStore& store);
// The remarks as lines "  look: ...".
std::string look_text(const std::vector<std::string>& remarks);

}  // namespace megablock
