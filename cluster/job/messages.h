// Sends the messages of a run to the console, as plain lines for a person, and to the log of this rank
// (cluster/process/job_log.h), with stage and unit.
#pragma once

#include <string>

#include "cluster/job/job.h"
#include "cluster/job/job_record.h"

namespace megablock {

// Tells what a stage does or has found. The console shows it on the first rank, unless the run is quiet: "merge
// iteration 3: ...".
void say(const Job& job, const std::string& stage, const std::string& text);

// Gives a warning, which the console shows even if the run is quiet: "merge        warning: ...".
void warn(const Job& job, const std::string& stage, const std::string& text);

// Gives a warning that the report and `status` list among the notes of the job; the console of the run does not show
// it. All ranks call it with the same text.
void add_note(const Job& job, JobRecord& record, const std::string& stage, const std::string& text);

// Warns of a damaged file of the job, which is computed again: "megablock: warning: FILE: PROBLEM; it is computed
// again". `stage`: for the log; empty before the first stage. `problem` is the text of JobStore::problem().
void warn_of_damage(const JobStore& store, const JobLog& log, const std::string& stage, const std::string& unit,
                    const std::string& problem);

}  // namespace megablock
