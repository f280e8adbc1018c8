// Records the units and failures of a stage in job/stages/<stage>.json. Rank 0 writes the record when the stage begins
// and when it ends. `status` compares the records with the unit files; the events only say how long the units took.
//
// Each record holds a hash of the records before it (`basis`). It shows that a stage is stale when the units of an
// earlier stage have changed since, although the files of the stage exist.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "cluster/job/stage.h"
#include "io/result/result.h"
#include "io/store/job/events.h"
#include "io/store/job/job_store.h"

namespace megablock {

struct StageRecord {
  std::string stage;
  std::uint64_t basis = 0;                                   // hash() of the record before; 0: the first stage
  std::vector<std::pair<std::string, std::uint64_t>> units;  // file, fingerprint
  std::vector<FailedUnit> failures;
  std::uint64_t hash() const;  // of basis and units
};

void write_record(const JobStore& store, const StageRecord& record);
// Returns nothing when there is no record. Throws StoreError when it is not readable.
std::optional<StageRecord> read_record(const JobStore& store, const std::string& stage);
// Removes the record, if any, of a stage that the job no longer runs.
void remove_record(const JobStore& store, const std::string& stage);

enum class StageState { kWaiting, kPartial, kDone, kStale };
const char* name_of(StageState state);  // "waiting" ...

struct StageStatus {
  StageRecord record;
  StageState state = StageState::kWaiting;
  std::int64_t done = 0;  // units whose file exists and is up to date
};
// The states of these stages, which are in the order in which they run. An optional stage is not
// listed when it has no units and the next stage has some.
std::vector<StageStatus> stage_status(const JobStore& store, const std::vector<Stage>& expected);

// Wall clock and memory of a stage, over all runs of the job: the time during which any rank worked on its units. Of
// each unit the latest event counts; of a merge, all events since the merge before.
StageStatistics stage_statistics(const StageRecord& record, const std::vector<UnitEvent>& events);

}  // namespace megablock
