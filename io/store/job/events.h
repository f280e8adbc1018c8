// Events of a job: one line of JSON per unit done or failed, in one file per run and rank, events/<start>-<rank>.jsonl.
// For the report and for people; what is done and what is not follows from the unit files alone.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "io/base/descriptor.h"
#include "io/store/job/job_store.h"

namespace megablock {

struct UnitEvent {
  double time_s = 0;        // end of the unit, seconds since 1970; set by EventLog::append
  std::string stage, unit;  // "features", "features/000003.h5"
  int rank = 0;
  double seconds = 0;        // wall clock of the unit
  double claim_seconds = 0;  // of it, waiting for the claim
  std::int64_t bytes = 0;    // of the unit's file
  double peak_rss_mib = 0;   // of the rank until now
  std::string failure;       // reason; empty when the unit was done
  // Further figures of the unit by name: what the merge cost (cluster/stages/merge/merge_tiles.h).
  std::map<std::string, double> figures;
};

// Appends to this run's file of one rank. Each line goes out in one write, so that a killed run tears at most its last.
class EventLog {
 public:
  // Errors as throw_file_error (io/base/file_error.h).
  EventLog(const JobStore& store, int rank);
  void append(UnitEvent event);
  const std::string& path() const { return path_; }

 private:
  std::string path_;
  Descriptor file_;
};

double seconds_since_1970();  // now, by the system's clock

// All events of all runs and ranks, ordered by time, then rank, then unit. A torn last line of a file is left out; a
// malformed line before it is a StoreError with file and line.
std::vector<UnitEvent> read_events(const JobStore& store);

}  // namespace megablock
