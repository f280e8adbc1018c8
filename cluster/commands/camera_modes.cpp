#include "cluster/commands/camera_modes.h"

#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>

#include "adjust/calibration/model_comparison.h"
#include "adjust/calibration/panoramic.h"
#include "cluster/job/job.h"
#include "cluster/outcome/calibration_input.h"
#include "cluster/process/exit_codes.h"
#include "cluster/process/version.h"
#include "io/base/error.h"
#include "io/base/file_error.h"
#include "io/block/calibration.h"

namespace megablock {

namespace {

JobStore output_folder(const RunOptions& run) {
  make_folder(run.directory);
  return JobStore(std::filesystem::absolute(run.directory).string());
}

struct PanoramicSettings {
  bool chosen = false;
  std::string model;          // empty: that of the camera
  double image_sigma_px = 0;  // 0: that of the project
};

// The observations of one camera. Each track has at most one observation in an image.
PanoramicTracks tracks_of(const CalibrationInput& input, CameraIndex camera) {
  PanoramicTracks result;
  std::map<ImageIndex, int> number;
  for (std::int64_t t = 0; t < input.tracks.track_count(); ++t) {
    std::vector<std::int64_t> rows;
    for (std::int64_t row = input.tracks.begin[t]; row < input.tracks.begin[t + 1]; ++row)
      if (input.block.camera_of(input.tracks.image[row]) == camera) rows.push_back(row);
    if (rows.size() < 2) continue;
    for (const std::int64_t row : rows) {
      const ImageIndex image = input.tracks.image[row];
      const auto [entry, added] = number.try_emplace(image, static_cast<int>(number.size()));
      if (added) result.images.push_back(input.block.name_of(image));
      result.image.push_back(entry->second);
      result.pixel.emplace_back(from_fixed_pixel(input.tracks.x[row]), from_fixed_pixel(input.tracks.y[row]));
    }
    result.begin.push_back(std::ssize(result.image));
  }
  return result;
}

Intrinsics start_of(const Camera& camera, const std::string& model_given) {
  if (model_given.empty()) return camera.intrinsics;
  const auto model = find_model(model_given);
  if (!model) throw InputError("--model: '" + model_given + "' is not a camera model; the models are " + model_list());
  if (*model == camera.intrinsics.model()) return camera.intrinsics;
  return start_intrinsics(*model, camera.intrinsics[kFocal], camera.width, camera.height);
}

std::string text_of(const Camera& camera, const Intrinsics& start, const PanoramicResult& result) {
  const CameraModel& model = start.model();
  std::string text = fmt::format(
      "{}: {}, {} x {} px\n  {} images, {} homologous points, {} measurements ({} rejected)\n"
      "  RMS {:.3f} px (start {:.3f} px), noise {:.3f} px per axis, {} degrees of freedom\n"
      "  chi-square {:.0f} at a noise of {:.3f} px; structure over the sensor {:.3f} px (p {:.3g}); {:.0f} % of the "
      "residuals along one displacement of the centre (noise: 50 %)\n",
      camera.name, model_name(model), camera.width, camera.height,
      std::count(result.linked.begin(), result.linked.end(), 1), result.tracks, result.observations, result.rejected,
      result.rms_px, result.start_rms_px, result.sigma_px, result.degrees_of_freedom, result.chi2,
      result.sigma_px / std::sqrt(result.chi2 / static_cast<double>(result.degrees_of_freedom)),
      result.structure.structure_px, result.structure.probability, 100 * result.parallax.along);
  text += fmt::format("  {:<8}{:>16}{:>16}{:>12}\n", "", "start", "calibrated", "sigma");
  for (int p = 0; p < start.size(); ++p) {
    if (is_fixed(model, p)) continue;
    const auto k = static_cast<std::size_t>(p);
    text += fmt::format("  {:<8}{:>16.7g}{:>16.7g}{:>12}\n", parameter_name(model, p), start[k], result.camera[k],
                        contains(result.free, p) ? fmt::format("{:.2g}", result.sigma(p)) : "held");
  }
  for (const std::string& warning : result.warnings) text += "  warning: " + warning + "\n";
  return text;
}

CameraCalibration calibration_of(const Camera& camera, const Intrinsics& start, const PanoramicResult& result) {
  CameraCalibration calibration{camera.name, start, result.camera};
  for (int p = 0; p < start.size(); ++p)
    if (contains(result.free, p)) calibration.sigma[static_cast<std::size_t>(p)] = result.sigma(p);
  return calibration;
}

void add_to(RigFit& fit, double rms_px, std::int64_t observations) {
  fit.images.squares += rms_px * rms_px * static_cast<double>(observations);
  fit.images.observations += observations;
}

int calibrate_panoramic_cameras(const PanoramicSettings& settings, const RunOptions& run) {
  const CalibrationInput input = read_calibration_input(run.project, JobTracks::kAll);
  PanoramicOptions options;
  options.image_sigma_px =
      settings.image_sigma_px > 0 ? settings.image_sigma_px : input.adjustment.observations.image_sigma_px;
  RigCalibration calibration;
  calibration.project = run.project;
  calibration.mode = "panoramic";
  for (CameraIndex c(0); input.block.cameras.contains(c); ++c.value) {
    const Camera& camera = input.block.cameras[c];
    try {
      const Intrinsics start = start_of(camera, settings.model);
      const PanoramicResult result =
          calibrate_panoramic(tracks_of(input, c), start, camera.width, camera.height, options);
      std::printf("%s", text_of(camera, start, result).c_str());
      calibration.cameras.push_back(calibration_of(camera, start, result));
      calibration.frames += std::count(result.linked.begin(), result.linked.end(), 1);
      add_to(calibration.before, result.start_rms_px, result.observations);
      add_to(calibration.after, result.rms_px, result.observations);
    } catch (const InputError& error) {
      throw InputError(camera.name + ": " + error.what());
    } catch (const ComputeError& error) {
      throw ComputeError(camera.name + ": " + error.what());
    }
  }
  const JobStore folder = output_folder(run);
  folder.write_text("calibration.yaml", calibration_yaml(calibration, kProgram));
  std::printf("%s\n", folder.path("calibration.yaml").c_str());
  return kExitDone;
}

struct ComparisonSettings {
  bool chosen = false;
  std::vector<std::string> models;
  ModelComparisonOptions options;
};

std::vector<ModelCandidate> candidates_of(const ComparisonSettings& settings, const Block& block) {
  if (settings.models.empty()) return default_candidates(block.cameras.front().intrinsics.model());
  std::vector<ModelCandidate> candidates;
  for (const std::string& name : settings.models) candidates.push_back(find_candidate(name));
  return candidates;
}

int compare_camera_models(const ComparisonSettings& settings, const RunOptions& run) {
  const CalibrationInput input = read_calibration_input(run.project, JobTracks::kAdjusted);
  if (input.block.cameras.empty()) throw InputError(run.project + ": the block has no camera");
  ModelComparisonOptions options = settings.options;
  options.adjustment = input.adjustment;
  const ModelComparison comparison =
      compare_models(input.block, input.state, input.tracks, candidates_of(settings, input.block), options);
  std::printf("%lld frames, %lld images, %lld points, %lld measurements\n", static_cast<long long>(comparison.frames),
              static_cast<long long>(comparison.images), static_cast<long long>(comparison.points),
              static_cast<long long>(comparison.observations));
  for (std::size_t c = 0; c < comparison.cameras.size(); ++c)
    std::printf("%s\n%s", input.block.cameras[comparison.cameras[c]].name.c_str(),
                comparison_table(comparison, c).c_str());
  const JobStore folder = output_folder(run);
  folder.write_text("models.html", comparison_page(comparison, input.block, run.project));
  std::printf("%s\n", folder.path("models.html").c_str());
  return kExitDone;
}

}  // namespace

CalibrateMode add_panoramic(CLI::App& command) {
  auto settings = std::make_shared<PanoramicSettings>();
  command.add_flag("--panoramic", settings->chosen,
                   "Cameras turned about their own centre: from homologous points alone (project or job)");
  command.add_option("--model", settings->model, "Panoramic: camera model [that of the camera]");
  command.add_option("--image-sigma", settings->image_sigma_px,
                     "Panoramic: noise that residuals are tested against, px per axis [that of the project]");
  return {[settings] { return settings->chosen; },
          [settings](const RunOptions& run) { return calibrate_panoramic_cameras(*settings, run); }};
}

CalibrateMode add_compare_models(CLI::App& command) {
  auto settings = std::make_shared<ComparisonSettings>();
  ModelComparisonOptions& options = settings->options;
  command.add_flag("--compare-models", settings->chosen,
                   "Adjust camera models of growing order and recommend one (project or job)");
  command
      .add_option("--models", settings->models, "Compare: models, 'ign-radial/2' with two radial terms [a list of 18]")
      ->delimiter(',');
  command.add_option("--max-frames", options.sample.max_frames, "Compare: frames of the block taken")
      ->capture_default_str();
  command.add_option("--max-measurements", options.sample.max_observations, "Compare: measurements taken")
      ->capture_default_str();
  command.add_option("--structure-probability", options.probability, "Compare: p below which a field has structure")
      ->capture_default_str();
  return {[settings] { return settings->chosen; },
          [settings](const RunOptions& run) { return compare_camera_models(*settings, run); }};
}

}  // namespace megablock
