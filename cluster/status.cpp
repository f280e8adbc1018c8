#include "cluster/status.h"

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

#include "cluster/job_json.h"
#include "cluster/progress.h"
#include "cluster/stage_record.h"
#include "io/error.h"
#include "io/events.h"
#include "io/feature_statistics.h"
#include "io/remarks.h"
#include "io/result.h"
#include "io/track_batches.h"
#include "io/unit_files.h"

namespace megablock {

namespace {

using Json = nlohmann::json;

std::vector<StageStatus> stages_of(const JobStore& store, const JobJson& job) {
  return stage_status(store, !job.value<std::string>("tie_points", "").empty());
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

Json failures_json(const JobJson& job, const std::vector<StageStatus>& stages,
                   const std::optional<BlockResult>& result) {
  Json list = Json::array();
  const auto add = [&](const std::string& stage, const std::string& unit, const std::string& reason) {
    list.push_back({{"stage", stage}, {"unit", unit}, {"reason", reason}});
  };
  if (result) {  // with the images that got no pose
    for (const FailedUnit& failure : result->failures) add(failure.stage, failure.unit, failure.reason);
    return list;
  }
  for (const auto& [file, reason] : job.value("unreadable", std::vector<std::pair<std::string, std::string>>()))
    add("init", file, reason);
  for (const StageStatus& stage : stages)
    for (const FailedUnit& failure : stage.record.failures) add(failure.stage, failure.unit, failure.reason);
  return list;
}

Json observation_kinds(const ObservationTable& table) {
  Json kinds = Json::object();
  for (std::size_t k = 0; k < kObservationKinds; ++k) {
    const ObservationStatistics& s = table.kinds[k];
    if (s.count == 0) continue;
    const double factor = s.sigma_factor();
    kinds[word_of(static_cast<ObservationKind>(k))] = {{"count", s.count},
                                                       {"redundancy", s.redundancy},
                                                       {"sigma_factor", std::isfinite(factor) ? Json(factor) : Json()}};
  }
  return kinds;
}

Json interest_points_json(const BlockResult& result) {
  Json list = Json::array();
  const auto statistics = feature_statistics(result);
  for (CameraIndex c(0); statistics.contains(c); ++c.value) {
    const FeatureStatistics& s = statistics[c];
    if (s.images == 0) continue;
    list.push_back({{"camera", result.block.cameras[c].name},
                    {"images", s.images},
                    {"least", s.least},
                    {"most", s.most},
                    {"mean", s.mean()},
                    {"total", s.total}});
  }
  return list;
}

void add_figures(Json& json, const BlockResult& result, const TrackBatches& tracks) {
  const ReprojectionStatistics statistics = reprojection_statistics(result, tracks);
  json["images"] = result.block.images.size();
  json["oriented"] = statistics.oriented_images;
  json["points"] = statistics.points;
  json["observations"] = statistics.observations;
  json["mean_track_length"] = statistics.mean_track_length;
  json["mean_reprojection_px"] = statistics.mean_px;
  json["rms_reprojection_px"] = statistics.rms_px;
  json["chi2_per_dof"] = result.variance_factor;
  json["degrees_of_freedom"] = result.degrees_of_freedom;
  json["image_sigma_px"] = result.image_sigma_px;
  json["observation_kinds"] = observation_kinds(result.observation_table);
  json["tiles"] = result.tiles.tile_count;
  json["boundary_frames"] = std::count(result.boundary.begin(), result.boundary.end(), 1);
  json["global_iterations"] = result.global_iterations;
  json["newton_decrement"] = result.newton_decrement;
  json["gauge"] = result.gauge;
  json["control_points_unused"] = unused_points(result, PointRole::kControl).size();
  json["check_points_unused"] = unused_points(result, PointRole::kCheck).size();
  json["interest_points"] = interest_points_json(result);
  json["remarks"] = remarks(result, tracks);
  json["digest"] = result.digest;
}

// All keys from the start; null where nothing is known yet.
Json status(const JobStore& store) {
  const JobJson job = JobJson::of_job(store);
  const std::vector<StageStatus> stages = stages_of(store, job);
  std::optional<BlockResult> result;
  if (store.seal(kResult)) result = read_result_without_tracks(store.verified_path(kResult));
  const std::optional<JobHolder> holder = holder_of(store);
  Json json{{"job", store.directory()},
            {"in_use_by", holder ? Json(holder->who) : Json()},
            {"stages", stages_json(store, stages)}};
  for (const char* key : {"oriented", "points", "observations", "mean_track_length", "mean_reprojection_px",
                          "rms_reprojection_px", "chi2_per_dof", "degrees_of_freedom", "observation_kinds", "tiles",
                          "boundary_frames", "global_iterations", "newton_decrement", "gauge", "digest",
                          "control_points_unused", "check_points_unused", "interest_points", "remarks"})
    json[key] = nullptr;
  const bool only_block = !result && store.seal("block.h5");
  json["images"] = only_block ? read_block(store.verified_path("block.h5")).images.size() : 0;
  const bool current = stages.back().state == StageState::kDone;
  json["result"] = !result ? "none" : current ? "current" : "stale";
  if (result) add_figures(json, *result, StoredTracks(store.path(kResult)));
  if (!current) result.reset();
  json["failures"] = failures_json(job, stages, result);
  json["failed"] = json["failures"].size();
  return json;
}

std::string stage_line(const Json& stage) {
  std::string name = stage["name"];
  name.resize(14, ' ');
  const auto expected = stage["units_expected"].get<std::int64_t>();
  std::string line = "  " + name + stage["state"].get<std::string>();
  if (expected > 0)
    line += ", " + std::to_string(stage["units"].get<std::int64_t>()) + " of " + std::to_string(expected) + " units";
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
  char line[512];
  std::snprintf(line, sizeof line,
                "  %lld of %lld images oriented, %lld points, %lld observations, mean residual %.3f px\n"
                "  sigma0 squared %.4f with %.3f px per tie point measurement, %lld tiles, %lld boundary frames, %lld "
                "global iterations\n  digest %s\n",
                json["oriented"].get<long long>(), json["images"].get<long long>(), json["points"].get<long long>(),
                json["observations"].get<long long>(), json["mean_reprojection_px"].get<double>(),
                json["chi2_per_dof"].get<double>(), json["image_sigma_px"].get<double>(),
                json["tiles"].get<long long>(), json["boundary_frames"].get<long long>(),
                json["global_iterations"].get<long long>(), json["digest"].get<std::string>().c_str());
  return line;
}

std::string interest_points_text(const Json& list) {
  std::string text;
  constexpr std::size_t kShown = 20;
  for (std::size_t i = 0; i < std::min(kShown, list.size()); ++i) {
    char line[128];
    std::snprintf(line, sizeof line, ": %lld to %lld interest points per image, mean %.0f, %lld in %lld images\n",
                  list[i]["least"].get<long long>(), list[i]["most"].get<long long>(), list[i]["mean"].get<double>(),
                  list[i]["total"].get<long long>(), list[i]["images"].get<long long>());
    text += "  " + list[i]["camera"].get<std::string>() + line;
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
  for (const std::string remark : json["remarks"]) text += "  look: " + remark + "\n";
  return text;
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
  return read_result_without_tracks(store.verified_path(kResult)).digest;
}

}  // namespace megablock
