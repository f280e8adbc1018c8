// What a stage was asked to do and what failed in it: job/stages/<stage>.json, written by rank 0 when the stage begins
// and when it ends. `status` compares the records with the unit files; the events only tell how long it took.
//
// Each record holds a hash of the records before it (`basis`), so that a stage whose forerunners were asked for
// something else since is known to be stale, whatever files it has.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "io/result/result.h"
#include "io/store/job/events.h"
#include "io/store/job/job_store.h"

namespace megablock {

struct StageRecord {
  std::string stage;
  std::uint64_t basis = 0;                                   // hash() of the record before, 0: the first stage
  std::vector<std::pair<std::string, std::uint64_t>> units;  // file, fingerprint
  std::vector<FailedUnit> failures;
  std::uint64_t hash() const;  // of basis and units
};

void write_record(const JobStore& store, const StageRecord& record);
// Empty when there is none; StoreError when it is not readable.
std::optional<StageRecord> read_record(const JobStore& store, const std::string& stage);
// Of a stage that the job as it is asked for now does without. Fine when there is none.
void remove_record(const JobStore& store, const std::string& stage);

enum class StageState { kWaiting, kPartial, kDone, kStale };
const char* name_of(StageState state);  // "waiting" ...

struct StageStatus {
  StageRecord record;
  StageState state = StageState::kWaiting;
  std::int64_t done = 0;  // units that are there and up to date
};
struct ExpectedStage {
  std::string name;
  bool optional = false;  // left out when it has no units and the stage behind it has some
};
// The states of these stages, which are in the order in which they run (cluster/stages/stages.h).
std::vector<StageStatus> stage_status(const JobStore& store, const std::vector<ExpectedStage>& expected);

// Wall clock and memory of a stage: the time during which any rank worked on its units (each unit's latest event;
// those of a merge since the one before), over all runs that took part.
StageStatistics stage_statistics(const StageRecord& record, const std::vector<UnitEvent>& events);

}  // namespace megablock
