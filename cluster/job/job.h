// What every stage of a run shares: the store, the ranks, the options, the record of what happened.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "cluster/job/job_options.h"
#include "cluster/job/paged_tables.h"
#include "cluster/job/stage_record.h"
#include "cluster/mpi/communicator.h"
#include "cluster/process/job_log.h"
#include "cluster/process/process_memory.h"
#include "io/block/block.h"
#include "io/result/result.h"
#include "io/store/job/events.h"
#include "io/store/job/job_store.h"

namespace megablock {

// Of memory or scratch of a rank, so that their bytes are far from the end of 64 bits.
constexpr double kMostMib = 1e12;

struct RunOptions {
  std::string project;      // block.yaml
  std::string directory;    // of the job
  int threads = 0;          // per rank; 0 = cores of the host / ranks on it
  double memory_mib = 0;    // per rank for factors of the merge; 0 = half of the host's memory / ranks on it
  double record_s = 30;     // of work between two records of a pass of the merge; 0: after every subtree
  double scratch_mib = -1;  // per rank for the merge's files in the job's scratch; -1 = as long as its disk lasts
  bool strict = false;      // a failed unit ends the run
  bool quiet = false;       // no progress
  std::string last_stage;   // stop after this stage; empty = all
  JobLogOptions log;        // of the log of each rank
};

struct Job {
  RunOptions options;
  Communicator& ranks;
  JobStore store;
  JobOptions settings;
  EventLog events;
  JobLog log;
  Block block;
  std::vector<std::int64_t> generations;                // image counts at which the block grew; the last is its size
  std::vector<StageRecord> records;                     // of the stages so far, in order
  std::vector<FailedUnit> failures;                     // of all stages so far
  std::map<FrameIndex, std::string> not_oriented;       // by the initial orientation, and why
  std::vector<std::string> notes;                       // warnings for the report
  std::int64_t parts_done = 0;                          // of the unit in hand (work_queue.h)
  PeakMemory peak_memory = {};                          // of this rank
  PagedTables tables = PagedTables(store.directory());  // where those of the block lie

  bool is_first_rank() const { return ranks.rank() == 0; }
};

}  // namespace megablock
