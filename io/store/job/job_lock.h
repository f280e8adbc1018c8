// The lock of a job: one run at a time works on a job directory.
#pragma once

#include <optional>
#include <string>

#include "io/store/job/job_store.h"

namespace megablock {

// The run that holds a job's lock.
struct JobHolder {
  std::string who = "another process";               // "process 1234 on host, started 2026-11-21T07:00:00Z"
  std::string how_to_stop = "kill -USR1 <process>";  // after the units in hand: "kill -USR1 1234", on another host so
};
std::optional<JobHolder> holder_of(const JobStore& store);  // empty: nobody

// The job's lock, held by rank 0 for the life of the object: flock on job/lock with host, pid and start time in it.
class JobLock {
 public:
  // Waits up to `patience_s` for a dying predecessor, then throws InputError naming the holder.
  explicit JobLock(const JobStore& store, double patience_s = 10);
  ~JobLock();
  JobLock(const JobLock&) = delete;
  JobLock& operator=(const JobLock&) = delete;

 private:
  int file_ = -1;
};

}  // namespace megablock
