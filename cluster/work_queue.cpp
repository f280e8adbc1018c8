#include "cluster/work_queue.h"

#include <algorithm>
#include <numeric>
#include <nlohmann/json.hpp>

#include "cluster/collective.h"
#include "cluster/process_memory.h"
#include "cluster/progress.h"
#include "cluster/signals.h"
#include "io/error.h"

namespace megablock {

namespace {

using Json = nlohmann::json;

bool is_current(const JobStore& store, const Unit& unit) {
  if (!store.up_to_date(unit.name, unit.fingerprint)) return false;
  try {
    store.verify(unit.name);
  } catch (const StoreError&) {
    return false;  // altered or truncated: computed again
  }
  return true;
}

std::vector<std::size_t> claim_order(const std::vector<Unit>& units) {
  std::vector<std::size_t> order(units.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return units[a].cost > units[b].cost; });
  return order;
}

// What one rank did, exchanged at the end of the stage.
struct RankRecord {
  std::vector<std::pair<std::size_t, std::string>> failures;  // unit number, reason
  std::int64_t computed = 0;
  double peak_rss_mib = 0;
};

std::string to_text(const RankRecord& record) {
  return Json{{"failures", record.failures}, {"computed", record.computed}, {"rss", record.peak_rss_mib}}.dump(
      -1, ' ', false, Json::error_handler_t::replace);
}

RankRecord from_text(const std::string& text) {
  const Json json = Json::parse(text);
  RankRecord record;
  json.at("failures").get_to(record.failures);
  json.at("computed").get_to(record.computed);
  json.at("rss").get_to(record.peak_rss_mib);
  return record;
}

void compute_unit(Job& job, const std::string& stage, const Unit& unit, double claim_s) {
  const double start = monotonic_seconds();
  const UnitSeal seal = job.store.write(unit.name, unit.fingerprint, unit.write);
  UnitEvent event;
  event.stage = stage;
  event.unit = unit.name;
  event.rank = job.ranks.rank();
  event.seconds = monotonic_seconds() - start;
  event.claim_seconds = claim_s;
  event.bytes = static_cast<std::int64_t>(seal.length);
  event.peak_rss_mib = peak_rss_mib();
  job.events.append(event);
}

}  // namespace

StageOutcome run_stage(Job& job, const std::string& stage, const std::vector<Unit>& units) {
  const double start = monotonic_seconds();
  reset_peak_rss();
  job.ranks.reset_counter();
  RankRecord mine;
  std::string fatal;  // concerns the run, not the unit: a full disk, a read-only job
  {
    Progress progress(stage, static_cast<std::int64_t>(units.size()), [&] { return job.ranks.counter(); },
                      job.options.quiet || !job.is_first_rank());
    const std::vector<std::size_t> order = claim_order(units);
    while (!stop_requested()) {
      const double before_claim = monotonic_seconds();
      const std::int64_t number = job.ranks.claim();
      const double claim_s = monotonic_seconds() - before_claim;
      if (number >= static_cast<std::int64_t>(order.size())) break;
      const std::size_t index = order[static_cast<std::size_t>(number)];
      const Unit& unit = units[index];
      if (is_current(job.store, unit)) continue;
      try {
        compute_unit(job, stage, unit, claim_s);
        ++mine.computed;
      } catch (const InputError& error) {
        fatal = error.what();
        break;
      } catch (const std::exception& error) {
        mine.failures.emplace_back(index, error.what());
        if (job.options.strict) break;
      }
    }
    mine.peak_rss_mib = peak_rss_mib();
  }
  share_error(job.ranks, 'i', fatal);
  if (job.ranks.any(stop_requested()))
    throw AgreedError<Interrupted>("stopped in stage '" + stage + "' as asked; run the same command to resume");

  StageOutcome outcome;
  StageStatistics statistics{stage, 0, 0, static_cast<std::int64_t>(units.size()), 0};
  std::vector<std::pair<std::size_t, std::string>> failures;
  for (const std::string& text : job.ranks.gather_all(to_text(mine))) {
    const RankRecord record = from_text(text);
    failures.insert(failures.end(), record.failures.begin(), record.failures.end());
    outcome.computed += record.computed;
    statistics.peak_rss_mib = std::max(statistics.peak_rss_mib, record.peak_rss_mib);
  }
  std::sort(failures.begin(), failures.end());
  for (const auto& [index, reason] : failures) outcome.failures.push_back({stage, units[index].name, reason});
  statistics.failed = static_cast<std::int64_t>(failures.size());
  statistics.seconds = monotonic_seconds() - start;
  job.statistics.push_back(statistics);
  job.failures.insert(job.failures.end(), outcome.failures.begin(), outcome.failures.end());
  if (job.options.strict && !failures.empty())
    throw AgreedError<ComputeError>("stage '" + stage + "', unit " + outcome.failures.front().unit + ": " +
                       outcome.failures.front().reason);
  return outcome;
}

}  // namespace megablock
