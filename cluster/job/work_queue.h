// A stage = a list of units; ranks claim them from the shared counter.
//
// A unit is skipped when its file is up to date and whole, else computed by the rank that claimed it. An error in one
// unit is recorded with its reason and the stage goes on. The list must be the same on every rank; a unit's result
// depends on its inputs alone, so it does not matter who computes it.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "cluster/job/job.h"
#include "io/result/result.h"

namespace megablock {

struct Unit {
  std::string name;               // its file in the job: "features/000003.h5"
  std::uint64_t fingerprint = 0;  // of everything it is computed from
  double cost = 0;                // any scale; units are claimed by decreasing cost, then in list order
  std::function<void(const std::string& path)> write;  // computes and writes the payload
  std::int64_t parts = 1;  // that progress counts; write() reports what it has done of them by part_done()
};

struct StageOutcome {
  std::vector<FailedUnit> failures;  // the same on every rank, in unit order
  std::int64_t computed = 0;         // by all ranks
};

// Collective. Throws Interrupted (on every rank) after a graceful stop. With job.options.strict a failed unit ends the
// run with ComputeError.
// The stage's record (stage_record.h) grows by these units. Progress counts their parts by this name.
StageOutcome run_stage(Job& job, const std::string& stage, const std::vector<Unit>& units,
                       const std::string& parts = "units");
// Of the unit in hand, from one thread at a time.
void part_done(Job& job, std::int64_t parts = 1);

// Whether a unit is there, whole and made of what it is to be made of now. One that is damaged is named on standard
// error.
bool is_current(const Job& job, const std::string& unit, std::uint64_t fingerprint);

// What run_stage does around its units, for a stage that has another way of computing: its units join the record of
// the stage, which rank 0 writes.
void begin_stage(Job& job, const std::string& stage, const std::vector<Unit>& units);
// Failures found after a stage, such as images of a unit: listed with the job's, recorded by rank 0.
void add_failures(Job& job, const std::vector<FailedUnit>& failures);

}  // namespace megablock
