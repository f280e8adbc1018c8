#include "cluster/status/status.h"

#include <fmt/core.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

#include "cluster/job/job_json.h"
#include "cluster/job/stage.h"
#include "cluster/job/stage_record.h"
#include "cluster/outcome/result_figures.h"
#include "cluster/process/progress.h"
#include "io/base/error.h"
#include "io/result/result.h"
#include "io/store/job/events.h"
#include "io/store/job/job_lock.h"
#include "io/store/units/block_file.h"
#include "io/text/counted.h"

namespace megablock {

namespace {

using Json = nlohmann::json;

std::vector<StageStatus> stages_of(const JobStore& store, const JobJson& job) {
  return stage_status(store, stages_of_job(!job.value<std::string>("tie_points", "").empty()));
}

Json stages_json(const JobStore& store, const std::vector<StageStatus>& stages) {
  const std::vector<UnitEvent> events = read_events(store);
  Json list = Json::array();
  for (const StageStatus& stage : stages) {
    const StageStatistics statistics = stage_statistics(stage.record, events);
    list.push_back({{"name", stage.record.stage},
                    {"state", name_of(stage.state)},
                    {"units", stage.done},
                    {"units_expected", stage.record.units.size()},
                    {"seconds", statistics.seconds},
                    {"peak_rss_mib", statistics.peak_rss_mib},
                    {"failed", statistics.failed}});
  }
  return list;
}

Json failures_json(const JobJson& job, const std::vector<StageStatus>& stages) {
  Json list = Json::array();
  const auto add = [&](const std::string& stage, const std::string& unit, const std::string& reason) {
    list.push_back({{"stage", stage}, {"unit", unit}, {"reason", reason}});
  };
  for (const auto& [file, reason] : job.value("unreadable", std::vector<std::pair<std::string, std::string>>()))
    add("init", file, reason);
  for (const StageStatus& stage : stages)
    for (const FailedUnit& failure : stage.record.failures) add(failure.stage, failure.unit, failure.reason);
  return list;
}

// All keys are present from the start; the value is null where nothing is known yet.
Json status(const JobStore& store) {
  const JobJson job = JobJson::of_job(store);
  const std::vector<StageStatus> stages = stages_of(store, job);
  const bool has_result = store.seal(kResult).has_value();
  const std::optional<JobHolder> holder = holder_of(store);
  Json json{{"job", store.directory()},
            {"in_use_by", holder ? Json(holder->who) : Json()},
            {"stages", stages_json(store, stages)}};
  for (const char* key : {"oriented",
                          "points",
                          "observations",
                          "mean_track_length",
                          "mean_reprojection_px",
                          "rms_reprojection_px",
                          "chi2_per_dof",
                          "degrees_of_freedom",
                          "observation_kinds",
                          "tiles",
                          "boundary_frames",
                          "global_iterations",
                          "newton_decrement",
                          "gauge",
                          "digest",
                          "control_points_unused",
                          "check_points_unused",
                          "check_points",
                          "seams",
                          "interest_points",
                          "remarks",
                          "notes"})
    json[key] = nullptr;
  const bool only_block = !has_result && store.seal("block.h5");
  json["images"] = only_block ? read_block(store.verified_path("block.h5")).images.size() : 0;
  const bool current = stages.back().state == StageState::kDone;
  json["result"] = !has_result ? "none" : current ? "current" : "stale";
  json["failures"] = failures_json(job, stages);
  if (has_result) {
    Json figures = Json::parse(result_figures(store));
    if (!current) figures["failures"] = json["failures"];
    json.update(figures);
  }
  json["failed"] = json["failures"].size();
  return json;
}

std::string stage_line(const Json& stage) {
  std::string name = stage["name"];
  name.resize(14, ' ');
  const auto expected = stage["units_expected"].get<std::int64_t>();
  std::string line = "  " + name + stage["state"].get<std::string>();
  if (expected > 0)
    line += ", " + std::to_string(stage["units"].get<std::int64_t>()) + " of " + counted(expected, "unit");
  if (const double seconds = stage["seconds"]; seconds > 0) line += ", " + duration_text(seconds);
  if (const auto failed = stage["failed"].get<std::int64_t>(); failed > 0)
    line += ", " + std::to_string(failed) + " failed";
  return line + "\n";
}

std::string failure_lines(const Json& failures) {
  constexpr std::size_t kShown = 10;
  std::string text;
  for (std::size_t i = 0; i < std::min(kShown, failures.size()); ++i)
    text += "  failed: " + failures[i]["stage"].get<std::string>() + " " + failures[i]["unit"].get<std::string>() +
            ": " + failures[i]["reason"].get<std::string>() + "\n";
  if (failures.size() > kShown)
    text += "  ... and " + std::to_string(failures.size() - kShown) + " more, all in 'megablock status --json'\n";
  return text;
}

std::string figures_text(const Json& json) {
  const auto number = [&](const char* key) { return json[key].get<std::int64_t>(); };
  return fmt::format(
      "  {} of {} oriented, {}, {}, mean residual {:.3f} px\n"
      "  sigma0 squared {:.4f} with {:.3f} px per tie point observation, {}, {}, {}\n  digest {}\n",
      number("oriented"), counted(number("images"), "image"), counted(number("points"), "point"),
      counted(number("observations"), "observation"), json["mean_reprojection_px"].get<double>(),
      json["chi2_per_dof"].get<double>(), json["image_sigma_px"].get<double>(), counted(number("tiles"), "tile"),
      counted(number("boundary_frames"), "separator frame"), counted(number("global_iterations"), "global iteration"),
      json["digest"].get<std::string>());
}

std::string check_points_text(const Json& check) {
  if (check["compared"] == 0) return "";
  const Json& ratio = check["normalised_error"];
  return fmt::format("  {}: rms of adjusted - given {:.4f} m horizontal, {:.4f} m vertical{}\n",
                     counted(check["compared"].get<std::int64_t>(), "check point"),
                     check["rms_horizontal_m"].get<double>(), check["rms_vertical_m"].get<double>(),
                     ratio.is_null() ? "" : fmt::format(", {:.2f} of their sigmas", ratio.get<double>()));
}

std::string seams_text(const Json& seams) {
  const auto alarms = seams["alarms"].get<std::int64_t>();
  if (alarms == 0) return "";
  return fmt::format(
      "  seams: {} of {} {} an alarm, the sides differ up to {:.1f} times what their sigmas explain; see the report\n",
      alarms, counted(seams["tested"].get<std::int64_t>(), "joint"), alarms == 1 ? "raises" : "raise",
      seams["largest_sigmas"].get<double>());
}

std::string notes_text(const Json& notes) {
  constexpr std::size_t kShown = 10;
  std::string text;
  for (std::size_t i = 0; i < std::min(kShown, notes.size()); ++i)
    text += "  note: " + notes[i].get<std::string>() + "\n";
  if (notes.size() > kShown) text += fmt::format("  ... and {} more in the report\n", notes.size() - kShown);
  return text;
}

std::string interest_points_text(const Json& list) {
  std::string text;
  constexpr std::size_t kShown = 20;
  for (std::size_t i = 0; i < std::min(kShown, list.size()); ++i) {
    const auto number = [&](const char* key) { return list[i][key].get<std::int64_t>(); };
    text += fmt::format("  {}: {} to {} per image, mean {:.0f}, {} in {}\n", list[i]["camera"].get<std::string>(),
                        number("least"), counted(number("most"), "interest point"), list[i]["mean"].get<double>(),
                        number("total"), counted(number("images"), "image"));
  }
  if (list.size() > kShown) text += "  ... all cameras in 'megablock status --json'\n";
  return text;
}

}  // namespace

std::string status_json(const JobStore& store) {
  return status(store).dump(1, ' ', false, Json::error_handler_t::replace);
}

std::string status_text(const JobStore& store) {
  const Json json = status(store);
  std::string text = "job " + store.directory() + "\n";
  for (const Json& stage : json["stages"]) text += stage_line(stage);
  text += failure_lines(json["failures"]);
  const std::optional<JobHolder> holder = holder_of(store);
  if (holder)
    text += "  " + holder->who + ", is at work on it; '" + holder->how_to_stop + "' stops it after the units in hand\n";
  if (json["result"] == "none")
    return text + "  no result yet" + (holder ? "" : ": run the same command again to resume") + "\n";
  if (json["result"] == "stale")
    text += std::string("  the result is older than what was asked of the job since") +
            (holder ? "" : ": run it to the end again") + "\n";
  text += figures_text(json);
  text += interest_points_text(json["interest_points"]);
  text += check_points_text(json["check_points"]) + seams_text(json["seams"]);
  return text + look_text(json["remarks"]) + notes_text(json["notes"]);
}

bool job_is_done(const JobStore& store) {
  return stages_of(store, JobJson::of_job(store)).back().state == StageState::kDone;
}

std::vector<std::string> unfinished_stages(const JobStore& store) {
  std::vector<std::string> lines;
  const std::optional<JobHolder> holder = holder_of(store);
  const auto remedy = [&](const std::string& purpose) {
    return holder ? holder->who + ", is at work on it" : "run the job again to " + purpose;
  };
  for (const StageStatus& stage : stages_of(store, JobJson::of_job(store))) {
    const auto units = static_cast<std::int64_t>(stage.record.units.size());
    const auto failed = static_cast<std::int64_t>(stage.record.failures.size());
    const std::string name = "stage '" + stage.record.stage + "': ";
    if (stage.state == StageState::kStale)
      lines.push_back(name + "its input or options changed since; " + remedy("bring it up to date"));
    else if (stage.done + failed < units)
      lines.push_back(name + std::to_string(stage.done) + " of " + std::to_string(units) + " units are there; " +
                      remedy("complete it"));
  }
  return lines;
}

std::string status_digest(const JobStore& store) {
  JobJson::of_job(store);
  if (!store.seal(kResult))
    throw InputError(store.directory() + ": the job has no result yet; run it to the end first");
  return read_result_digest(store.verified_path(kResult));
}

}  // namespace megablock
