// Verifies all files of a job (`megablock check`).
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "io/store/job/job_store.h"

namespace megablock {

// Whether a run has used this folder, even one that was interrupted before it wrote job.json.
bool holds_job(const JobStore& store);

// The files of a stage.
struct StageFiles {
  std::string kind;                                   // of its HDF5 files; empty: it has none
  std::function<void(const std::string& path)> read;  // throws if the contents do not have their format
  std::string folder_by_tile;                         // where they are, if there is one for each tile; else empty
  std::string folder = {};                            // where they are alone; empty: nowhere
  std::string ending = ".h5";                         // of their names in this folder
  std::function<void(const JobStore&)> check = {};    // throws what is wrong with its files that have no seal
};

// Reads every file of the job and returns one line per problem, with the name of the file. An empty list means that all
// files are sound. `stages`: files that a run makes besides its block and its result. Problems are:
//
// * units without a valid seal, damaged, of another version, or whose contents do not have their format;
// * a result whose digest is not that of its contents, or whose observations are incomplete;
// * tiles without a file of a stage for which other tiles have one;
// * files in the folder of a stage that no stage made;
// * text files that cannot be parsed, or do not fit the block.
//
// Throws InputError if there is no job (holds_job).
std::vector<std::string> check_job(const JobStore& store, const std::vector<StageFiles>& stages);

}  // namespace megablock
