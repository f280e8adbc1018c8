// Makes three kinds of test, from the cheap to the thorough: the seal of a unit fits its bytes
// (JobStore::verified_path), its contents have their format (the reader of its kind), and units fit each other (digest,
// index, tiles). An error in one file does not end the check, so that one run lists everything that is damaged.
#include "io/result/check.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>

#include "io/base/error.h"
#include "io/block/registration.h"
#include "io/result/measurement_index.h"
#include "io/result/measurements.h"
#include "io/result/result.h"
#include "io/result/result_digest.h"
#include "io/result/track_batches.h"
#include "io/store/hdf5/hdf5_file.h"
#include "io/store/job/events.h"
#include "io/store/units/block_file.h"
#include "io/store/units/graph_files.h"
#include "io/store/units/registration_file.h"
#include "io/store/units/state_file.h"

namespace megablock {

namespace {

class Check {
 public:
  Check(const JobStore& store, const std::vector<StageFiles>& stages) : store_(store), stages_(stages) {}

  std::vector<std::string> run() {
    if (!std::filesystem::exists(store_.directory()))
      throw InputError(store_.directory() + ": no such job directory; check the path");
    if (!holds_job(store_))
      throw InputError(store_.directory() + ": is no job directory; name the folder given to 'run -j'");
    attempt([&] { check_text(); });
    for (const std::string& name : units()) attempt([&] { check_unit(name); });
    attempt([&] { check_tile_files(); });
    for (const StageFiles& stage : stages_)
      if (stage.check) attempt([&] { stage.check(store_); });
    return std::move(problems_);
  }

 private:
  // Runs an action. An error that it throws becomes one problem of the list, unless the list has it.
  void attempt(const std::function<void()>& action) {
    try {
      action();
    } catch (const Error& error) {
      if (std::ranges::find(problems_, error.what()) == problems_.end()) problems_.emplace_back(error.what());
    }
  }

  void check_text() {
    const std::string path = store_.path("job.json");
    std::ifstream file(path);
    if (!file) throw StoreError(path + ": is missing; this is no job, or its first run was interrupted: run it again");
    if (!nlohmann::json::accept(file)) throw StoreError(path + ": is not valid JSON; restore it or start a new job");
    read_events(store_);
  }

  // The names of all sealed files: the .h5 files in the job's own folder, all files in the folders of the stages, and
  // the result.
  std::vector<std::string> units() const {
    std::vector<std::string> names;
    for (const std::string& name : store_.list("")) {
      const bool top = name.find('/') == std::string::npos;
      // Logs, events and figures of the stages are text and have no seals; scratch and merge/parts belong to runs in
      // progress.
      const bool text = name.starts_with("events/") || name.starts_with("log/") || name.starts_with("stages/") ||
                        name.starts_with("scratch/") || name.starts_with("merge/parts/") ||
                        (name.starts_with("result/") && name != kResult) ||
                        (name.starts_with("register/") && !name.ends_with(".h5"));
      if (top ? name.ends_with(".h5") : !text) names.push_back(name);
    }
    return names;
  }

  // Files that a user has put into the folder of a stage.
  bool is_foreign(const std::string& name) const {
    const std::string folder = name.substr(0, name.find('/'));
    const auto stage = std::ranges::find(stages_, folder, &StageFiles::folder);
    return stage != stages_.end() && folder != name && !name.ends_with(stage->ending) && name != kTrackList &&
           !store_.seal(name);
  }

  void check_unit(const std::string& name) {
    if (is_foreign(name)) throw StoreError(store_.path(name) + ": is no file of a job; move it away");
    const std::string path = store_.verified_path(name);
    if (!name.ends_with(".h5")) return;  // only its stage can read its contents
    const std::string kind = file_kind(path);
    if (kind == "result") {
      check_result(path);
    } else {
      std::map<std::string, std::function<void()>> readers = {
          {"block", [&] { check(read_block(path)); }},
          {kMeasurementIndexKind, [&] { check_measurement_index(store_); }},
          {"state", [&] { read_state(path); }},
          {"places", [&] { read_places(path); }},
          {"registrations", [&] { read_registrations(path); }},
          {"trajectory", [&] { read_trajectory(path); }}};
      for (const StageFiles& stage : stages_)
        if (stage.read) readers[stage.kind] = [&] { stage.read(path); };
      if (const auto reader = readers.find(kind); reader != readers.end()) reader->second();
    }
  }

  void check_result(const std::string& path) {
    const BlockResult result = read_result_without_tracks(path);
    const StoredTracks tracks(path);
    ResultDigest contents(result.state, tracks.track_count());
    tracks.visit([&](const TrackResults& batch) { contents.add(batch); });
    const std::string digest = contents.text();
    if (digest != result.digest)
      throw StoreError(path + ": its digest is " + result.digest + ", but that of its contents is " + digest +
                       "; delete it and run again");
  }

  // Some stages have one unit per tile. If some tiles have their file, all must have one.
  void check_tile_files() {
    if (!store_.seal("tiles.h5")) return;
    const std::int64_t tiles = read_tiles(store_.verified_path("tiles.h5")).tile_count;
    if (store_.seal(kTrackList) && !std::filesystem::exists(store_.path(kMeasurementIndex)))
      problems_.push_back(store_.path(kMeasurementIndex) + ": is missing; run the job again to make it");
    for (const StageFiles& stage : stages_) {
      const std::string& folder = stage.folder_by_tile;
      if (folder.empty()) continue;
      const std::vector<std::string> names = store_.list(folder);
      std::int64_t found = 0;
      for (const std::string& name : names) found += name.ends_with(stage.ending);
      if (found > 0 && found < tiles)
        problems_.push_back(store_.path(folder) + ": has files of " + std::to_string(found) + " of " +
                            std::to_string(tiles) + " tiles; run the job again to complete it");
    }
  }

  const JobStore& store_;
  const std::vector<StageFiles>& stages_;
  std::vector<std::string> problems_;
};

}  // namespace

bool holds_job(const JobStore& store) {
  std::error_code error;
  return std::ranges::any_of(std::vector{"job.json", "lock", "events"},
                             [&](const char* own) { return std::filesystem::exists(store.path(own), error); });
}

std::vector<std::string> check_job(const JobStore& store, const std::vector<StageFiles>& stages) {
  return Check(store, stages).run();
}

}  // namespace megablock
