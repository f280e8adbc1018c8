// Gives the text of `megablock status`: the state of a job from the records of its stages, the unit files and the
// result. Times and memory come from the events.
#pragma once

#include <string>
#include <vector>

#include "io/store/job/job_store.h"

namespace megablock {

std::string status_json(const JobStore& store);
std::string status_text(const JobStore& store);
// Whether every stage is done and nothing has changed since.
bool job_is_done(const JobStore& store);
// One line for each stage that has begun and lacks units, or whose inputs have changed since.
std::vector<std::string> unfinished_stages(const JobStore& store);
// The digest of the finished result. Throws InputError when the job has no result yet.
std::string status_digest(const JobStore& store);

}  // namespace megablock
