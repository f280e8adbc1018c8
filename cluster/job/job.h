// Gives every stage the run of a job: the store, the ranks, the options, the block. A stage writes its files into the
// store, the input of later stages into its results, and events into the record of the run (job_record.h).
#pragma once

#include <string>
#include <vector>

#include "adjust/problem/tile_problem.h"
#include "cluster/job/job_options.h"
#include "cluster/job/paged_tables.h"
#include "cluster/mpi/communicator.h"
#include "cluster/process/job_log.h"
#include "io/block/block.h"
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
  HalfChoice half;          // of a split test: `directory` is a finished job then, whose project is not read again
  JobLogOptions log;        // options of the log of each rank
};

// The block of a run, and its large tables outside of memory. Stages read it through Job. Between their units
// of work some change it: names come and go, focal_lengths and cameras set start values and free parameters of the
// cameras, the orientation sets verticals aside, gives positions shifts and leaves mirrored lists out, `register` puts
// an estimated rig in, and the merge moves it into the result.
struct JobBlock {
  Block block;
  PagedTables tables;
};

struct Job {
  RunOptions options;
  Communicator& ranks;
  JobStore store;
  JobOptions settings;
  JobLog log;
  const Block& block;                     // of a JobBlock. Names may be absent; it is empty after the merge.
  const PagedTables& tables;              // of the same
  std::vector<std::int64_t> generations;  // image counts at which the block grew; the last is its size

  bool is_first_rank() const { return ranks.rank() == 0; }
};

}  // namespace megablock
