// What a job says of itself: `megablock status`, derived from the stages' records, the unit files and the result. Times
// and memory come from the events.
#pragma once

#include <string>

#include "io/job_store.h"

namespace megablock {

std::string status_json(const JobStore& store);
std::string status_text(const JobStore& store);
// Every stage is done and nothing was asked for since.
bool job_is_done(const JobStore& store);
// The digest of the finished result; InputError when the job has none yet.
std::string status_digest(const JobStore& store);

}  // namespace megablock
