// Holds the record of a run: events, stages, failures and notes. Stages write it through run_stage() and its like
// (work_queue.h) and add_note() (messages.h).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "cluster/job/stage_record.h"
#include "cluster/process/process_memory.h"
#include "io/result/result.h"
#include "io/store/job/events.h"

namespace megablock {

struct JobRecord {
  EventLog events;
  std::vector<StageRecord> stages;   // that have begun, in order
  std::vector<FailedUnit> failures;  // of all stages so far
  std::vector<std::string> notes;    // warnings for the report
  std::int64_t parts_done = 0;       // of the present unit (work_queue.h)
  PeakMemory peak_memory = {};       // of this rank
};

}  // namespace megablock
