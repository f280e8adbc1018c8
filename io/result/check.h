// Verifies all files of a job (`megablock check`).
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "io/store/job/job_store.h"

namespace megablock {

// Whether a run has used this folder, even one that was interrupted before it wrote job.json.
bool holds_job(const JobStore& store);

// The unit files of a stage.
struct StageFiles {
  std::string kind;                                   // of its HDF5 files
  std::function<void(const std::string& path)> read;  // throws what is wrong with a file
  std::string folder_by_tile;                         // where they are, if there is one for each tile; else empty
};

// Reads every file of the job and returns one line per problem, naming the file: units without a whole seal, damaged,
// of another version, or that cannot be read as what they are; a result whose digest is not that of its contents or
// whose observations are incomplete; a tile in the block's partition without its file where other tiles have theirs;
// text files that do not parse. `stages`: files that a run makes besides its block and its result. Empty: every file
// is whole. Throws InputError when there is no job (holds_job).
std::vector<std::string> check_job(const JobStore& store, const std::vector<StageFiles>& stages);

}  // namespace megablock
