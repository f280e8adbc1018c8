// Runs the units of a stage over all ranks. The ranks claim units from a shared counter, so that no rank is a master.
//
// A unit whose file is up to date and undamaged is skipped; any other unit is computed by the rank that claims it. An
// error in a unit is recorded with its reason, and the stage goes on. The list of units must be the same on every rank.
// The result of a unit depends on its inputs alone, so that it does not matter which rank computes it.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "cluster/job/job.h"
#include "cluster/job/job_record.h"
#include "cluster/job/stage.h"
#include "io/result/result.h"

namespace megablock {

struct Unit {
  std::string name;               // its file in the job: "features/000003.h5"
  std::uint64_t fingerprint = 0;  // hash of everything from which it is computed
  double cost = 0;                // any scale; units are claimed by decreasing cost, then in list order
  std::function<void(const std::string& path)> write;  // computes and writes the payload
  std::int64_t parts = 1;  // parts that progress counts; write() reports finished ones with part_done()
};

struct StageOutcome {
  std::vector<FailedUnit> failures;  // the same on every rank, in unit order
  std::int64_t computed = 0;         // by all ranks
};

// Collective. Throws Interrupted on every rank after a graceful stop. With job.options.strict a failed unit ends the
// run with ComputeError. The units are added to the record of the stage (stage_record.h).
StageOutcome run_stage(const Job& job, JobRecord& record, const Stage& stage, const std::vector<Unit>& units);
// Reports finished parts of the present unit. Only one thread at a time may call it.
void part_done(const Job& job, JobRecord& record, std::int64_t parts = 1);

// Whether the file of a unit exists, is undamaged and was made from the present inputs. A warning names a damaged file.
bool is_current(const Job& job, const std::string& stage, const std::string& unit, std::uint64_t fingerprint);

// The first part of run_stage(), for a stage that computes its units in another way: adds the units to the record of
// the stage, which rank 0 writes.
void begin_stage(const Job& job, JobRecord& record, const Stage& stage, const std::vector<Unit>& units);
// Adds failures that were found after a stage, such as single images of a unit, to those of the job and to the record
// of the stage.
void add_failures(const Job& job, JobRecord& record, const std::vector<FailedUnit>& failures);

}  // namespace megablock
