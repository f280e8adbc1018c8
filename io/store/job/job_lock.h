// Locks a job, so that only one run at a time works on its directory.
//
// The lock is flock on an open file and not the existence of the file: the kernel releases it when the process ends,
// even by kill -9, so that no killed run leaves a job locked. The text inside is for people and for messages; nothing
// is decided by it.
#pragma once

#include <optional>
#include <string>

#include "io/store/job/job_store.h"

namespace megablock {

// The run that holds the lock of a job.
struct JobHolder {
  std::string who = "another process";  // "process 1234 on host, started 2026-11-21T07:00:00Z"
  // Stops it after its current units: "kill -USR1 1234", with the name of another host added.
  std::string how_to_stop = "kill -USR1 <process>";
};
std::optional<JobHolder> holder_of(const JobStore& store);  // empty: nobody

// The lock of a job, which rank 0 holds during the life of the object: flock on job/lock, which contains host, process
// and start time.
class JobLock {
 public:
  // Waits up to `patience_s` for a run that is ending, then throws InputError with the name of the holder.
  explicit JobLock(const JobStore& store, double patience_s = 10);
  ~JobLock();
  JobLock(const JobLock&) = delete;
  JobLock& operator=(const JobLock&) = delete;

 private:
  int file_ = -1;
};

}  // namespace megablock
