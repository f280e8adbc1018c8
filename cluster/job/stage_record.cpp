#include "cluster/job/stage_record.h"

#include <algorithm>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "io/base/error.h"
#include "io/base/hash.h"

namespace megablock {

namespace {

using Json = nlohmann::json;

std::string file_of(const std::string& stage) { return "stages/" + stage + ".json"; }

bool iterates(const StageRecord& record) {
  const Stage* stage = find_stage(record.stage);
  return stage != nullptr && stage->iterates;
}

// The events of the present units of a stage.
std::vector<UnitEvent> latest_events(const StageRecord& record, const std::vector<UnitEvent>& events) {
  std::vector<UnitEvent> found;
  if (iterates(record)) {  // the events of its iterations, and of the result that ends it
    bool ended = false;
    for (const UnitEvent& event : events) {
      if (event.stage != record.stage) continue;
      if (ended) found.clear();
      found.push_back(event);
      ended = !record.units.empty() && event.unit == record.units.front().first;
    }
    return found;
  }
  std::set<std::string> names;
  for (const auto& unit : record.units) names.insert(unit.first);
  std::map<std::string, UnitEvent> latest;
  for (const UnitEvent& event : events)
    if (event.stage == record.stage && names.contains(event.unit)) latest[event.unit] = event;
  for (const auto& [name, event] : latest) found.push_back(event);
  return found;
}

// The total length of the events' intervals; where they overlap, time counts once.
double covered_seconds(const std::vector<UnitEvent>& events) {
  std::vector<std::pair<double, double>> intervals;
  for (const UnitEvent& event : events) intervals.emplace_back(event.time_s - event.seconds, event.time_s);
  std::sort(intervals.begin(), intervals.end());
  double sum = 0, end = 0;
  for (const auto& [from, to] : intervals) {
    if (to > end) sum += to - std::max(from, end);
    end = std::max(end, to);
  }
  return sum;
}

}  // namespace

std::uint64_t StageRecord::hash() const {
  Hasher hasher;
  hasher.add(stage).add(basis);
  for (const auto& [name, fingerprint] : units) hasher.add(name).add(fingerprint);
  return hasher.value();
}

void write_record(const JobStore& store, const StageRecord& record) {
  Json failures = Json::array();
  for (const FailedUnit& failure : record.failures) failures.push_back({failure.stage, failure.unit, failure.reason});
  const Json json{{"stage", record.stage}, {"basis", record.basis}, {"units", record.units}, {"failures", failures}};
  store.write_text(file_of(record.stage), json.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n");
}

std::optional<StageRecord> read_record(const JobStore& store, const std::string& stage) {
  const std::string path = store.path(file_of(stage));
  std::ifstream in(path);
  if (!in) return std::nullopt;
  try {
    const Json json = Json::parse(in);
    StageRecord record{json.at("stage"), json.at("basis"), json.at("units"), {}};
    for (const Json& failure : json.at("failures")) record.failures.push_back({failure[0], failure[1], failure[2]});
    return record;
  } catch (const Json::exception&) {
    throw StoreError(path + ": is not readable; delete it, the next run writes it again");
  }
}

void remove_record(const JobStore& store, const std::string& stage) { store.remove(file_of(stage)); }

const char* name_of(StageState state) {
  static constexpr const char* kNames[] = {"waiting", "partial", "done", "stale"};
  return kNames[static_cast<int>(state)];
}

std::vector<StageStatus> stage_status(const JobStore& store, const std::vector<Stage>& expected) {
  std::vector<StageStatus> stages;
  std::uint64_t basis = 0;
  bool stale = false;
  for (const Stage& stage : expected) {
    StageStatus status;
    if (const auto record = read_record(store, stage.name)) {
      status.record = *record;
      for (const auto& [unit, fingerprint] : record->units) status.done += store.up_to_date(unit, fingerprint) ? 1 : 0;
      stale = stale || record->basis != basis;
      if (stale)
        status.state = StageState::kStale;
      else if (status.done == static_cast<std::int64_t>(record->units.size()))
        status.state = StageState::kDone;
      else if (status.done > 0)
        status.state = StageState::kPartial;
      basis = record->hash();
    } else {
      status.record.stage = stage.name;
    }
    stages.push_back(status);
  }
  for (std::size_t s = expected.size() - 1; s-- > 0;)
    if (expected[s].optional && stages[s].record.units.empty() && !stages[s + 1].record.units.empty())
      stages.erase(stages.begin() + static_cast<std::ptrdiff_t>(s));
  return stages;
}

StageStatistics stage_statistics(const StageRecord& record, const std::vector<UnitEvent>& events) {
  const std::vector<UnitEvent> own = latest_events(record, events);
  StageStatistics statistics;
  statistics.name = record.stage;
  statistics.seconds = covered_seconds(own);
  for (const UnitEvent& event : own) statistics.peak_rss_mib = std::max(statistics.peak_rss_mib, event.peak_rss_mib);
  statistics.units = static_cast<std::int64_t>(record.units.size());
  statistics.failed = static_cast<std::int64_t>(record.failures.size());
  return statistics;
}

}  // namespace megablock
