// Verification of all files of a job: `megablock check`.
#pragma once

#include <string>
#include <vector>

#include "io/store/job/job_store.h"

namespace megablock {

// Whether a run has been in the folder, be it one that was interrupted before it wrote job.json.
bool holds_job(const JobStore& store);

// Reads every file of the job and returns one line per problem, naming the file: units without a whole seal, damaged,
// of another version, or that cannot be read as what they are; a result whose digest is not that of its contents or
// whose observations are incomplete; a tile in the block's partition without its file where other tiles have theirs;
// text files that do not parse. Empty: every file is whole. Throws InputError when there is no job
// (holds_job).
std::vector<std::string> check_job(const JobStore& store);

}  // namespace megablock
