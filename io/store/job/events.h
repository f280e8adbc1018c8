// Writes and reads the events of a job: one line of JSON for each unit that was finished or failed. Each run and rank
// has its own file, events/<start>-<rank>.jsonl. Events are for the report and for people; the progress of the job
// follows only from the unit files.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "io/base/descriptor.h"
#include "io/store/job/job_store.h"

namespace megablock {

// The end of one unit of work.
struct UnitEvent {
  double time_s = 0;        // end of the unit, seconds since 1970; EventLog::append sets it
  std::string stage, unit;  // "features", "features/000003.h5"
  int rank = 0;
  double seconds = 0;        // duration of the unit by the wall clock
  double claim_seconds = 0;  // the part of the duration that was spent waiting for the claim
  std::int64_t bytes = 0;    // size of the unit's file
  double peak_rss_mib = 0;   // largest memory of the rank so far
  std::string failure;       // the reason of a failure; empty for a finished unit
  // Further figures of the unit by name, such as the cost of the merge (cluster/stages/merge/merge_tiles.h).
  std::map<std::string, double> figures;
};

// Appends events to this run's file of one rank. Each line is written at once, so a killed run can cut off only its
// last line.
class EventLog {
 public:
  // Throws as throw_file_error does (io/base/file_error.h).
  EventLog(const JobStore& store, int rank);
  void append(UnitEvent event);
  const std::string& path() const { return path_; }

 private:
  std::string path_;
  Descriptor file_;
};

double seconds_since_1970();  // the present, by the system's clock

// Returns the events of all runs and ranks, ordered by time, then rank, then unit. A last line that was cut off is left
// out. A malformed line before it is a StoreError with file and line.
std::vector<UnitEvent> read_events(const JobStore& store);

}  // namespace megablock
