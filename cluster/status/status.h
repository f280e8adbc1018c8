// What a job says of itself: `megablock status`, derived from the stages' records, the unit files and the result. Times
// and memory come from the events.
#pragma once

#include <string>
#include <vector>

#include "io/store/job/job_store.h"

namespace megablock {

std::string status_json(const JobStore& store);
std::string status_text(const JobStore& store);
// Every stage is done and nothing was asked for since.
bool job_is_done(const JobStore& store);
// One line per stage that has begun and whose units are not all there, or that was asked for something else since.
std::vector<std::string> unfinished_stages(const JobStore& store);
// The digest of the finished result; InputError when the job has none yet.
std::string status_digest(const JobStore& store);

}  // namespace megablock
