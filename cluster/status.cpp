#include "cluster/status.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>

#include "io/error.h"
#include "io/events.h"
#include "io/result.h"
#include "io/unit_files.h"

namespace megablock {

namespace {

using Json = nlohmann::json;

constexpr const char* kResult = "result/block.h5";

struct StageState {
  std::string name;
  std::int64_t expected = -1;  // units; -1: not known yet
  std::int64_t there = 0;
};

std::int64_t count(const JobStore& store, const std::string& folder) {
  std::int64_t sealed = 0;
  for (const std::string& unit : store.list(folder)) sealed += store.seal(unit) ? 1 : 0;
  return sealed;
}

std::int64_t exists(const JobStore& store, const std::string& unit) { return store.seal(unit) ? 1 : 0; }

std::vector<StageState> stage_states(const JobStore& store, bool given_tie_points) {
  std::vector<StageState> stages;
  const auto images = exists(store, "block.h5")
                          ? static_cast<std::int64_t>(read_block(store.verified_path("block.h5")).images.size())
                          : 0;
  if (!given_tie_points) {
    constexpr std::int64_t kShard = 64;
    stages.push_back({"features", (images + kShard - 1) / kShard, count(store, "features")});
    stages.push_back({"candidates", 1, exists(store, "graph.h5")});
    StageState matching{"matching", -1, count(store, "matches")};
    if (stages.back().there)
      matching.expected =
          static_cast<std::int64_t>(read_candidates(store.verified_path("graph.h5")).cell_begin.size()) - 1;
    stages.push_back(matching);
  }
  stages.push_back({"tiles", 1, exists(store, "tiles.h5")});
  const std::int64_t tiles = stages.back().there ? read_tiles(store.verified_path("tiles.h5")).tile_count : -1;
  stages.push_back({"tracks", tiles, std::max<std::int64_t>(0, count(store, "tracks") - exists(store, "tracks/index.txt"))});
  if (!given_tie_points) stages.push_back({"orientation", 1, std::min<std::int64_t>(1, count(store, "orient"))});
  stages.push_back({"adjustment", tiles, count(store, "adjust")});
  stages.push_back({"merge", 1, exists(store, kResult)});
  return stages;
}

std::string state_name(const StageState& stage, bool finished) {
  if (finished || (stage.expected >= 0 && stage.there >= stage.expected)) return "done";
  return stage.there > 0 ? "partial" : "waiting";
}

Json job_json(const JobStore& store) {
  std::ifstream in(store.path("job.json"));
  if (!in) throw InputError(store.directory() + ": is not a job directory (no job.json); name the folder given to 'run -j'");
  return Json::parse(in, nullptr, false);
}

Json stages_json(const JobStore& store, const Json& job, const std::optional<BlockResult>& result) {
  const bool given = job.is_object() && !job.value("tie_points", std::string()).empty();
  Json stages = Json::array();
  for (const StageState& stage : stage_states(store, given)) {
    Json entry{{"name", stage.name}, {"state", state_name(stage, result.has_value())}, {"units", stage.there},
               {"units_expected", stage.expected}, {"seconds", nullptr}, {"peak_rss_mib", nullptr}, {"failed", 0}};
    if (result) {
      for (const StageStatistics& s : result->stages) {
        if (s.name != stage.name) continue;
        entry["seconds"] = s.seconds;
        entry["peak_rss_mib"] = s.peak_rss_mib;
        entry["failed"] = s.failed;
      }
    }
    stages.push_back(entry);
  }
  return stages;
}

Json status(const JobStore& store) {
  const Json job = job_json(store);
  std::optional<BlockResult> result;
  if (store.seal(kResult)) result = read_result(store.verified_path(kResult));
  Json json{{"job", store.directory()}, {"stages", stages_json(store, job, result)}};
  if (result) {
    const ReprojectionStatistics statistics = reprojection_statistics(*result);
    json["images"] = result->block.images.size();
    json["oriented"] = statistics.oriented_images;
    json["points"] = statistics.points;
    json["observations"] = statistics.observations;
    json["mean_track_length"] = statistics.mean_track_length;
    json["mean_reprojection_px"] = statistics.mean_px;
    json["rms_reprojection_px"] = statistics.rms_px;
    json["chi2_per_dof"] = result->variance_factor;
    json["tiles"] = result->tiles.tile_count;
    json["boundary_frames"] = std::count(result->boundary.begin(), result->boundary.end(), 1);
    json["global_iterations"] = result->global_iterations;
    json["newton_decrement"] = result->newton_decrement;
    json["gauge"] = result->gauge;
    json["failed"] = result->failures.size();
    json["digest"] = result->digest;
  } else {
    json["images"] = store.seal("block.h5") ? read_block(store.verified_path("block.h5")).images.size() : 0;
    json["digest"] = nullptr;
  }
  return json;
}

}  // namespace

std::string status_json(const JobStore& store) { return status(store).dump(1, ' ', false, Json::error_handler_t::replace); }

std::string status_text(const JobStore& store) {
  const Json json = status(store);
  std::string text = "job " + store.directory() + "\n";
  for (const Json& stage : json["stages"]) {
    std::string name = stage["name"];
    name.resize(14, ' ');
    text += "  " + name + stage["state"].get<std::string>() + ", " + std::to_string(stage["units"].get<std::int64_t>());
    if (stage["units_expected"].get<std::int64_t>() >= 0)
      text += " of " + std::to_string(stage["units_expected"].get<std::int64_t>());
    text += " units\n";
  }
  if (json["digest"].is_null()) return text + "  no result yet: run the same command again to resume\n";
  char line[512];
  std::snprintf(line, sizeof line,
                "  %lld of %lld images oriented, %lld points, %lld observations, mean residual %.3f px\n"
                "  sigma0 squared %.4f, %lld tiles, %lld boundary frames, %lld global iterations\n  digest %s\n",
                json["oriented"].get<long long>(), json["images"].get<long long>(), json["points"].get<long long>(),
                json["observations"].get<long long>(), json["mean_reprojection_px"].get<double>(),
                json["chi2_per_dof"].get<double>(), json["tiles"].get<long long>(),
                json["boundary_frames"].get<long long>(), json["global_iterations"].get<long long>(),
                json["digest"].get<std::string>().c_str());
  return text + line;
}

std::string status_digest(const JobStore& store) {
  job_json(store);
  if (!store.seal(kResult))
    throw InputError(store.directory() + ": the job has no result yet; run it to the end first");
  return read_result(store.verified_path(kResult)).digest;
}

}  // namespace megablock
