#include "cluster/commands/calibrate_command.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "cluster/commands/camera_modes.h"
#include "cluster/mpi/collective.h"
#include "cluster/stages/pipeline.h"
#include "cluster/terminal/option_checks.h"
#include "cluster/terminal/output_check.h"

namespace megablock {

namespace {

const std::map<std::string, CalibrationMode> kModes = {
    {"all", CalibrationMode::kAll}, {"off-line", CalibrationMode::kOffLine}, {"on-line", CalibrationMode::kOnLine}};
const std::map<std::string, MountFreedom> kMounts = {{"stated", MountFreedom::kStated}, {"free", MountFreedom::kFree}};

constexpr const char* kCalibration = "calibration.yaml";

// Adds an option whose values have names.
template <typename Value>
void add_choice(CLI::App& command, const std::string& name, Value& value, const std::map<std::string, Value>& values,
                const std::string& usual, const std::string& help) {
  command
      .add_option_function<std::string>(
          name, [&](const std::string& chosen) { value = values.at(chosen); }, help)
      ->check(CLI::IsMember(values))
      ->default_str(usual);
}

void add_rig_options(CLI::App& command, CalibrationSettings& settings) {
  RigCalibrationOptions& rig = settings.rig;
  add_choice(command, "--mode", rig.mode, kModes, "all",
             "all: what the project has | off-line: control points | on-line: tie points");
  add_choice(command, "--mounts", rig.mounts, kMounts, "stated",
             "stated: sigmas of the project are priors | free: without priors, but the first is held");
  command.add_flag_callback(
      "--hold-intrinsics", [&rig] { rig.estimate_intrinsics = false; },
      "Cameras are held; else estimated as the project says");
  command
      .add_option("--verify", settings.verification,
                  "Project of another site that the rig recorded: decides whether the result is better than the start")
      ->check(CLI::ExistingFile);
  command.add_option("--held-out", rig.held_out_share, "Share of the points held out for that decision")
      ->capture_default_str();
  command
      .add_option("--max-position-sigma", rig.max_position_sigma_m,
                  "Largest sigma of a mount's position, m; above it: warning")
      ->capture_default_str();
  command
      .add_option("--max-rotation-sigma", rig.max_rotation_sigma_deg,
                  "Largest sigma of a mount's rotation, degrees; above it: warning")
      ->capture_default_str();
  command
      .add_option("--min-quadrant", rig.min_quadrant_measurements,
                  "Fewest measurements in a quadrant of a sensor; below it: warning")
      ->capture_default_str();
  command.add_flag("--json", settings.json, "Figures as JSON");
}

}  // namespace

void add_calibrate(CLI::App& app, std::function<int()>& action, Communicator& ranks) {
  auto options = std::make_shared<RunOptions>();
  auto settings = std::make_shared<CalibrationSettings>();
  options->directory = "calibration";
  CLI::App* command = app.add_subcommand("calibrate", "Calibrate the mounts and cameras of a rig");
  command->footer(
      "Example: megablock calibrate field.yaml -o calibration --mode off-line\n"
      "         megablock calibrate drive.yaml -o calibration --mode on-line --verify site.yaml\n"
      "         megablock calibrate --panoramic panorama.yaml -o calibration\n"
      "         megablock calibrate --compare-models job -o models\n"
      "Then: 'calibration: calibration/calibration.yaml' in the project file of any block of this rig");
  command->add_option("project", options->project, "Project file, or a job with --compare-models")->required();
  command->add_option("-o,--output", options->directory, "Folder for the calibration and its page")
      ->check(named())
      ->capture_default_str();
  command->add_option("--threads", options->threads, "Threads per rank; 0 = cores of the host / ranks on it")
      ->check(threads());
  add_log_level(*command, options->log.level);
  command->add_flag("-q,--quiet", options->quiet, "Do not show progress");
  add_rig_options(*command, *settings);
  auto modes = std::make_shared<std::vector<CalibrateMode>>();  // a function of its own file adds each of them
  modes->push_back(add_panoramic(*command));
  modes->push_back(add_compare_models(*command));
  command->callback([=, &action, &ranks] {
    action = [options, settings, modes, &ranks] {
      on_first_rank(ranks, [&] {
        const std::vector<std::string> inputs = inputs_of(options->project, "calibration");
        check_output(options->directory + "/" + kCalibration, inputs, kCalibration);
        // The calibration of rigs continues in its own job directory; other modes have none.
        if (std::ranges::any_of(*modes, [](const CalibrateMode& mode) { return mode.chosen(); }))
          check_output(options->directory, inputs);
        return std::string();
      });
      for (const CalibrateMode& mode : *modes)
        if (mode.chosen()) return exit_code_on_first_rank(ranks, [&] { return mode.run(*options); });
      return calibrate_job(*options, *settings, ranks);
    };
  });
}

}  // namespace megablock
