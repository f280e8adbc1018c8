#include "cluster/stages/pipeline/calibration.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>

#include "adjust/registration/frame_resection.h"
#include "cluster/job/given_tracks.h"
#include "cluster/job/stage.h"
#include "cluster/mpi/collective.h"
#include "cluster/process/version.h"
#include "io/evaluation/calibration_report.h"
#include "io/project/project.h"
#include "io/report/calibration_page.h"
#include "merge/rig/rig_calibration.h"

namespace megablock {

namespace {

bool all_oriented(const BlockState& state) {
  return std::all_of(state.oriented.begin(), state.oriented.end(), [](std::uint8_t o) { return o != 0; });
}

VerificationSite read_site(const std::string& file) {
  Project project = read_project(file, settings_sections());
  if (project.tie_points.empty())
    throw InputError(file + ": a verification site needs 'tie_points' in its project file");
  BlockState state = initial_state(project.block);
  resect_missing(project.block, state);
  for (FrameIndex f(0); project.block.frames.contains(f); ++f.value)
    if (state.oriented[f]) project.block.frames[f].given_pose = state.frames[f];
  TrackSet tracks = read_given_tracks(project.tie_points, project.block);
  return {std::move(project.block), std::move(tracks)};
}

// Frames without a pose take no part in the calibration.
void warn_of_lost_frames(const Block& block, const BlockState& start, RigCalibration& calibration) {
  const auto lost = std::count(start.oriented.begin(), start.oriented.end(), std::uint8_t{0});
  if (lost == 0) return;
  const auto first = std::find(start.oriented.begin(), start.oriented.end(), std::uint8_t{0}) - start.oriented.begin();
  calibration.warnings.push_back(std::to_string(lost) + " frames take no part: they have no pose and see no three " +
                                 "control points, the first of them '" + block.frames[FrameIndex(first)].name + "'");
}

std::string calibrate(const Job& job, const std::vector<std::string>& notes, const BlockState& start,
                      const TrackSet& tracks, const CalibrationSettings& settings) {
  std::optional<VerificationSite> site;
  if (!settings.verification.empty()) site = read_site(settings.verification);
  CalibratedRig rig = calibrate_rig(job.block, start, tracks, settings.rig, site);
  RigCalibration& calibration = rig.calibration;
  calibration.project = std::filesystem::path(job.options.project).filename().string();
  calibration.warnings.insert(calibration.warnings.end(), notes.begin(), notes.end());
  warn_of_lost_frames(job.block, start, calibration);
  const std::string name = calibration.refused.empty() ? "calibration.yaml" : "calibration-refused.yaml";
  job.store.write_text(name, calibration_yaml(calibration, kProgram));
  job.store.write_text("calibration.html", calibration_html(calibration, job.block));
  std::printf("%s\n", (settings.json ? calibration_json(calibration) : calibration_text(calibration)).c_str());
  if (!settings.json) std::printf("%s\n%s\n", job.store.path(name).c_str(), job.store.path("calibration.html").c_str());
  std::fflush(stdout);
  if (calibration.refused.empty()) return "";
  const bool only_there = calibration.verification && calibration.held_out_px < calibration.held_out_before_px;
  return "the calibration is refused, it is no better than the start: " + calibration.refused +
         ". The rig stays as it was; what was found is in " + job.store.path(name) +
         (only_there ? ". Was the site recorded with this rig? Else measure" : ". Measure") +
         " more, better spread over the images, or hold the cameras (--hold-intrinsics)";
}

}  // namespace

void resect_missing(const Block& block, BlockState& state) {
  if (all_oriented(state)) return;
  // Mounts and cameras are not calibrated yet, and their errors shift the observations.
  constexpr double kUncalibratedPx = 10, kPositionM = 1;
  Block rough = block;
  for (ControlPoint& point : rough.control_points)
    for (ImageMeasurement& m : point.measurements) m.sigma_px = std::max(m.sigma_px, kUncalibratedPx);
  RigResectionOptions options;
  options.max_position_sigma_m = kPositionM;
  for (const FrameResection& r : resect_frames(rough, {}, {}, options)) {
    if (!r.refused.empty() || state.oriented[r.frame]) continue;
    state.frames[r.frame] = r.resection.pose;
    state.oriented[r.frame] = 1;
  }
}

void run_calibration(const Job& job, const std::vector<std::string>& notes, const BlockState& start,
                     const TrackSet& tracks, const CalibrationSettings& settings) {
  const std::string refused = on_first_rank(job.ranks, [&] { return calibrate(job, notes, start, tracks, settings); });
  if (!refused.empty()) throw AgreedError<ComputeError>(refused);
}

}  // namespace megablock
