// A run of a job as every stage sees it: the store, the ranks, the options, the block, and the record of the units and
// failures.
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

// The largest memory or scratch of a rank, MiB. The number of bytes then stays far below the range of 64 bits.
constexpr double kMostMib = 1e12;

struct RunOptions {
  std::string project;      // the project file
  std::string directory;    // the job directory
  int threads = 0;          // per rank; 0 = cores of the host / ranks on it
  double memory_mib = 0;    // per rank, for tiles and factors of the merge; 0 = half of the host's memory / ranks on it
  double record_s = 30;     // s of work between two records of a sweep of the merge; 0: a record after every subtree
  double scratch_mib = -1;  // per rank, for the merge's files in the job's scratch; -1 = limited by the disk only
  bool strict = false;      // the first failed unit ends the run
  bool quiet = false;       // no progress
  std::string last_stage;   // stop after this stage; empty = all
  JobLogOptions log;        // options of the log of each rank
};

struct Job {
  RunOptions options;
  Communicator& ranks;
  JobStore store;
  JobOptions settings;
  EventLog events;
  JobLog log;
  Block block;
  std::vector<std::int64_t> generations;           // image counts at which the block grew; the last one is its size
  std::vector<StageRecord> records;                // of the stages that have begun, in order
  std::vector<FailedUnit> failures;                // of all stages so far
  std::map<FrameIndex, std::string> not_oriented;  // frames without a pose from the initial orientation, and why
  std::vector<std::string> notes;                  // warnings for the report
  std::int64_t parts_done = 0;                     // finished parts of the present unit (work_queue.h)
  PeakMemory peak_memory = {};                     // of this rank
  PagedTables tables = PagedTables(store.directory());  // the large tables of the block

  bool is_first_rank() const { return ranks.rank() == 0; }
};

}  // namespace megablock
