#include "cluster/job/work_queue.h"

#include <fmt/core.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <numeric>

#include "cluster/job/messages.h"
#include "cluster/mpi/collective.h"
#include "cluster/process/process_memory.h"
#include "cluster/process/progress.h"
#include "cluster/process/signals.h"
#include "io/base/error.h"
#include "io/text/counted.h"

namespace megablock {

namespace {

using Json = nlohmann::json;

std::vector<std::size_t> claim_order(const std::vector<Unit>& units) {
  std::vector<std::size_t> order(units.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return units[a].cost > units[b].cost; });
  return order;
}

// The failures and counts of one rank, which are exchanged at the end of the stage.
struct RankRecord {
  std::vector<std::pair<std::size_t, std::string>> failures;  // unit number, reason
  std::int64_t computed = 0;
};

std::string to_text(const RankRecord& record) {
  return Json{{"failures", record.failures}, {"computed", record.computed}}.dump(-1, ' ', false,
                                                                                 Json::error_handler_t::replace);
}

RankRecord from_text(const std::string& text) {
  const Json json = Json::parse(text);
  RankRecord record;
  json.at("failures").get_to(record.failures);
  json.at("computed").get_to(record.computed);
  return record;
}

// Computes and writes the unit and its event. A failure is recorded as an event too, and thrown again.
void compute_unit(const Job& job, JobRecord& record, const std::string& stage, const Unit& unit, double claim_s) {
  const double start = monotonic_seconds();
  UnitEvent event;
  event.stage = stage;
  event.unit = unit.name;
  event.rank = job.ranks.rank();
  event.claim_seconds = claim_s;
  const auto log = [&] {
    event.seconds = monotonic_seconds() - start;
    event.peak_rss_mib = peak_rss_mib();
    record.events.append(event);
    if (event.failure.empty())
      job.log.write(LogLevel::kDebug, stage, unit.name, fmt::format("done in {:.3f} s", event.seconds));
    else
      job.log.write(LogLevel::kError, stage, unit.name, event.failure);
  };
  try {
    event.bytes = static_cast<std::int64_t>(job.store.write(unit.name, unit.fingerprint, unit.write).length);
  } catch (const InputError&) {
    throw;  // it concerns the run, not the unit
  } catch (const std::exception& error) {
    event.failure = error.what();
    log();
    throw;
  }
  log();
}

void write_own_record(const Job& job, const JobRecord& record) {
  if (job.is_first_rank()) write_record(job.store, record.stages.back());
}

}  // namespace

bool is_current(const Job& job, const std::string& stage, const std::string& unit, std::uint64_t fingerprint) {
  std::string damage;
  const bool current = job.store.is_current(unit, fingerprint, damage);
  if (!damage.empty()) warn_of_damage(job.store, job.log, stage, unit, damage);
  return current;
}

void begin_stage(const Job& job, JobRecord& record, const Stage& stage, const std::vector<Unit>& units) {
  if (record.stages.empty() || record.stages.back().stage != stage.name)
    record.stages.push_back({stage.name, record.stages.empty() ? 0 : record.stages.back().hash(), {}, {}});
  for (const Unit& unit : units) record.stages.back().units.emplace_back(unit.name, unit.fingerprint);
  write_own_record(job, record);
}

void add_failures(const Job& job, JobRecord& record, const std::vector<FailedUnit>& failures) {
  if (failures.empty()) return;
  record.failures.insert(record.failures.end(), failures.begin(), failures.end());
  auto& recorded = record.stages.back().failures;
  recorded.insert(recorded.end(), failures.begin(), failures.end());
  write_own_record(job, record);
  if (job.options.strict)
    throw AgreedError<ComputeError>("stage '" + failures.front().stage + "', " + failures.front().unit + ": " +
                                    failures.front().reason);
}

void part_done(const Job& job, JobRecord& record, std::int64_t parts) {
  record.parts_done += parts;
  job.ranks.add_done(parts);
}

StageOutcome run_stage(const Job& job, JobRecord& record, const Stage& row, const std::vector<Unit>& units) {
  begin_stage(job, record, row, units);
  const std::string stage = row.name;
  const double start_s = monotonic_seconds();
  job.log.write(LogLevel::kInfo, stage, "", "begins: " + counted(std::ssize(units), "unit"));
  return_freed_memory();
  job.tables.release();
  record.peak_memory.begin_stage();
  job.ranks.reset_counter();
  RankRecord mine;
  std::string fatal;  // an error of the run, not of a unit: a full disk, a read-only job
  {
    const std::int64_t count = std::accumulate(units.begin(), units.end(), std::int64_t{0},
                                               [](std::int64_t sum, const Unit& unit) { return sum + unit.parts; });
    Progress progress(
        stage, count, row.parts, [&] { return job.ranks.done(); }, job.options.quiet || !job.is_first_rank());
    const std::vector<std::size_t> order = claim_order(units);
    while (!stop_requested()) {
      const double before_claim = monotonic_seconds();
      const std::int64_t number = job.ranks.claim();
      const double claim_s = monotonic_seconds() - before_claim;
      if (number >= static_cast<std::int64_t>(order.size())) break;
      const std::size_t index = order[static_cast<std::size_t>(number)];
      const Unit& unit = units[index];
      record.parts_done = 0;
      try {
        if (!is_current(job, stage, unit.name, unit.fingerprint)) {
          compute_unit(job, record, stage, unit, claim_s);
          job.tables.release();
          ++mine.computed;
        }
      } catch (const InputError& error) {
        fatal = error.what();
        break;
      } catch (const std::exception& error) {
        mine.failures.emplace_back(index, error.what());
        if (job.options.strict) job.ranks.use_up_counter();
      }
      part_done(job, record, unit.parts - record.parts_done);
    }
    if (stop_requested()) job.ranks.use_up_counter();  // the other ranks stop too, if only this one got the signal
    share_error(job.ranks, 'i', fatal);                // the progress shows the units of the others until they are done
  }
  if (job.ranks.any(stop_requested()))
    throw AgreedError<Interrupted>("stopped in stage '" + stage + "' as asked; run the same command to resume");

  StageOutcome outcome;
  std::vector<std::pair<std::size_t, std::string>> failures;
  for (const std::string& text : job.ranks.gather_all(to_text(mine))) {
    const RankRecord of_rank = from_text(text);
    failures.insert(failures.end(), of_rank.failures.begin(), of_rank.failures.end());
    outcome.computed += of_rank.computed;
  }
  std::sort(failures.begin(), failures.end());
  for (const auto& [index, reason] : failures) outcome.failures.push_back({stage, units[index].name, reason});
  job.log.write(
      LogLevel::kInfo, stage, "",
      fmt::format("ends after {:.3f} s: {} computed by this rank, {} by all, {} failed", monotonic_seconds() - start_s,
                  mine.computed, counted(outcome.computed, "unit"), outcome.failures.size()));
  add_failures(job, record, outcome.failures);
  return outcome;
}

}  // namespace megablock
