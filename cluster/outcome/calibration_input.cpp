#include "cluster/outcome/calibration_input.h"

#include <algorithm>
#include <filesystem>

#include "cluster/job/given_tracks.h"
#include "cluster/job/job_options.h"
#include "cluster/job/stage.h"
#include "io/base/error.h"
#include "io/project/project.h"
#include "io/result/result.h"
#include "io/store/job/job_store.h"
#include "io/store/units/block_file.h"
#include "io/store/units/tracks_file.h"

namespace megablock {

namespace {

constexpr const char *kBlock = "block.h5", *kTracks = "tracks";

void append_rows(const TrackSet& from, std::int64_t track, const std::vector<std::uint8_t>& kept, TrackSet& to) {
  const std::int64_t before = to.observation_count();
  for (std::int64_t row = from.begin[track]; row < from.begin[track + 1]; ++row) {
    if (!kept.empty() && !kept[static_cast<std::size_t>(row)]) continue;
    to.image.push_back(from.image[row]);
    to.x.push_back(from.x[row]);
    to.y.push_back(from.y[row]);
    to.feature.push_back(from.feature[row]);
  }
  if (to.observation_count() == before) return;
  to.id.push_back(from.id[track]);
  to.begin.push_back(to.observation_count());
}

void append_tracks(const TrackSet& from, const std::vector<std::uint8_t>& kept, TrackSet& to) {
  if (to.begin.empty()) to.begin.push_back(0);
  for (std::int64_t t = 0; t < from.track_count(); ++t) append_rows(from, t, kept, to);
}

CalibrationInput of_project(const std::string& path) {
  Project project = read_project(path, settings_sections());
  if (project.tie_points.empty())
    throw InputError(path + ": the project has no 'tie_points'; run 'megablock run " + path +
                     " -j JOB' and give JOB instead");
  TrackSet tracks = read_given_tracks(project.tie_points, project.block);
  const JobOptions options = read_options(project.settings);
  refuse_environment(options.environment, "calibrate");
  CalibrationInput input{std::move(project.block), {}, std::move(tracks), options.adjustment};
  input.state = initial_state(input.block);
  return input;
}

CalibrationInput of_finished_job(const JobStore& store) {
  BlockResult result = read_result(store.verified_path(kResult));
  CalibrationInput input{std::move(result.block), std::move(result.state), {}, {}};
  append_tracks(result.tracks, result.kept, input.tracks);
  if (result.image_sigma_px > 0) input.adjustment.observations.image_sigma_px = result.image_sigma_px;
  return input;
}

CalibrationInput of_matched_job(const JobStore& store) {
  const JobOptions options = options_of_job(store);
  refuse_environment(options.environment, "calibrate");
  CalibrationInput input{read_block(store.verified_path(kBlock)), {}, {}, options.adjustment};
  input.state = initial_state(input.block);
  for (const std::string& unit : store.list(kTracks))
    if (unit.ends_with(".h5")) append_tracks(read_tracks(store.verified_path(unit)), {}, input.tracks);
  return input;
}

}  // namespace

CalibrationInput read_calibration_input(const std::string& path, JobTracks tracks) {
  if (!std::filesystem::is_directory(path)) return of_project(path);
  const JobStore store(path);
  if (!std::filesystem::exists(store.path("job.json")))
    throw InputError(path + ": is no job directory (no job.json); give a job or a project file");
  if (tracks == JobTracks::kAdjusted) {
    if (!store.seal(kResult)) throw InputError(path + ": the job has no result yet; run it to the end first");
    return of_finished_job(store);
  }
  CalibrationInput input = of_matched_job(store);
  if (input.tracks.track_count() == 0)
    throw InputError(path + ": the job has no tie points yet; run 'megablock match' first");
  return input;
}

}  // namespace megablock
