// The messages of a run: each goes to the console, as plain lines for a person, and to the log of this rank
// (cluster/process/job_log.h) with its stage and unit.
#pragma once

#include <string>

#include "cluster/job/job.h"

namespace megablock {

// What a stage is doing or has found. The console shows it on the first rank, unless the run is quiet:
// "merge        iteration 3: ...".
void say(const Job& job, const std::string& stage, const std::string& text);

// A warning, which the console shows even if the run is quiet: "merge        warning: ...".
void warn(const Job& job, const std::string& stage, const std::string& text);

// A warning that the report and `status` list among the notes of the job. All ranks call it with the same text.
void add_note(Job& job, const std::string& stage, const std::string& text);

// A damaged file of the job that is computed again: "megablock: warning: FILE: PROBLEM; it is computed again".
// `problem` as JobStore::problem() gives it.
void warn_of_damage(const JobStore& store, const JobLog& log, const std::string& unit, const std::string& problem);

}  // namespace megablock
