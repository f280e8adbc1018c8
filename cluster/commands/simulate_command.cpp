#include "cluster/commands/simulate_command.h"

#include <omp.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <map>

#include "cluster/process/exit_codes.h"
#include "cluster/terminal/option_checks.h"
#include "cluster/terminal/output_check.h"
#include "io/base/error.h"
#include "io/simulate/blocks/simulate.h"
#include "io/simulate/files/write.h"
#include "io/simulate/files/write_rendered.h"

namespace megablock {

namespace {

using Scene = SimulationOptions::Scene;
using Path = SimulationOptions::Path;

const std::map<std::string, Scene> kScenes = {{"aerial", Scene::kAerial},
                                              {"street", Scene::kStreet},
                                              {"stereopolis", Scene::kStereopolis},
                                              {"target-field", Scene::kTargetField},
                                              {"panorama", Scene::kPanorama},
                                              {"courtyard", Scene::kCourtyard},
                                              {"tower", Scene::kTower}};
const std::map<std::string, Path> kPaths = {{"single", Path::kSingle}, {"line", Path::kLine},
                                            {"loop", Path::kLoop},     {"s", Path::kS},
                                            {"all", Path::kAll},       {"sparse", Path::kSparse}};

template <typename Value>
std::vector<std::string> names_in(const std::map<std::string, Value>& map) {
  std::vector<std::string> names;
  for (const auto& entry : map) names.push_back(entry.first);
  return names;
}

// The scenes on which an option has an effect (none named: all of them), and whether it concerns tie points or rendered
// images.
struct Effect {
  std::vector<std::string> scenes;
  enum class On { kBoth, kTiePoints, kRendered } on = On::kBoth;
};

const Effect kEverything, kTiePoints{{}, Effect::On::kTiePoints};
const Effect kAerial{{"aerial"}}, kStereopolis{{"stereopolis"}}, kTargetField{{"target-field"}},
    kPanorama{{"panorama"}};
const Effect kStreets{{"street", "stereopolis"}}, kTerrain{{"aerial", "street", "stereopolis"}};
const Effect kMoving{{"aerial", "street"}, Effect::On::kTiePoints};
const Effect kFourSides{{"courtyard", "tower"}, Effect::On::kRendered};
const Effect kVehicle{{"stereopolis", "target-field"}}, kRigs{{"street", "stereopolis", "target-field"}};
const Effect kAnyCamera{
    {"aerial", "street", "panorama", "courtyard", "tower"}};  // the cameras of the vehicle are of one model
const Effect kNoTrajectory{
    {"aerial", "street", "target-field", "panorama", "courtyard", "tower"}};  // position priors have white noise

// The options of the command line. An option that is not given has the default of the scene, which is known after
// parsing. An option that is given without an effect is refused.
class SimulateOptions {
 public:
  explicit SimulateOptions(CLI::App* command) : command_(command) {}

  template <typename Value>
  void add(const std::string& name, Value SimulationOptions::*member, const std::string& help,
           const Effect& effect = kEverything) {
    const CLI::Option* option = command_->add_option(name, given_.*member, help);
    has_effect(option, effect);
    settle_.push_back([this, option, member](SimulationOptions& options) {
      if (option->count() > 0) options.*member = given_.*member;
    });
  }
  void add_switch(const std::string& name, bool SimulationOptions::*member, const std::string& help,
                  const Effect& effect = kEverything, bool value = false) {
    has_effect(command_->add_flag_callback(
                   name, [this, member, value] { switched_.emplace_back(member, value); }, help),
               effect);
  }
  void has_effect(const CLI::Option* option, const Effect& effect) { effects_.emplace_back(option, effect); }
  SimulationOptions settled() const {
    for (const auto& [option, effect] : effects_)
      if (option->count() > 0) refuse_without_effect(option->get_name(), effect);
    SimulationOptions options = SimulationOptions::of(kScenes.at(scene), kPaths.at(path));
    for (const auto& settle : settle_) settle(options);
    for (const auto& [member, value] : switched_) options.*member = value;
    if (options.published_camera != 0) use_published_camera(options);
    return options;
  }

  std::string scene = "aerial", path = "s", output;
  bool rendered = false, overwrite = false;
  int threads = 0;

 private:
  void refuse_without_effect(const std::string& name, const Effect& effect) const {
    std::string scenes;
    for (const std::string& known : effect.scenes) scenes += (scenes.empty() ? "" : ", ") + known;
    if (!scenes.empty() && std::find(effect.scenes.begin(), effect.scenes.end(), scene) == effect.scenes.end())
      throw InputError(name + " has no effect on the scene '" + scene + "', only on: " + scenes +
                       "; leave it out, or choose another --scene");
    if (effect.on == Effect::On::kRendered && !rendered)
      throw InputError(name + " has no effect without --rendered; leave it out, or add that");
    if (effect.on == Effect::On::kTiePoints && rendered)
      throw InputError(name + " has no effect with --rendered; leave one of them out");
  }
  void use_published_camera(SimulationOptions& options) const {
    for (const char* name : {"--width", "--image-height", "--focal"})
      if (command_->count(name) > 0)
        throw InputError(std::string(name) + " has no effect with --published-camera, which has its own; leave it out");
    options.use_published_camera(options.published_camera);
  }

  CLI::App* command_;
  SimulationOptions given_;
  std::vector<std::pair<const CLI::Option*, Effect>> effects_;
  std::vector<std::function<void(SimulationOptions&)>> settle_;
  std::vector<std::pair<bool SimulationOptions::*, bool>> switched_;
};

void add_scene_options(SimulateOptions& s) {
  using O = SimulationOptions;
  s.add("--frames", &O::frames, "Frames [100; stereopolis 800, target-field 30, panorama 42, courtyard and tower 24]");
  s.add("--seed", &O::seed, "Seed [1]");
  s.add("--forward-overlap", &O::forward_overlap, "Aerial: along the row, 0..1 [0.8]", kAerial);
  s.add("--side-overlap", &O::side_overlap, "Aerial: between rows, 0..1 [0.6]", kAerial);
  s.add("--height", &O::height_m, "Aerial: above mean terrain, m [100]", kAerial);
  s.add("--relief", &O::terrain_relief_m, "Aerial, street, stereopolis: terrain relief, m [15]", kTerrain);
  s.add("--street-spacing", &O::street_spacing_m, "Street, stereopolis: between streets, m [100]", kStreets);
  s.add("--frame-distance", &O::frame_distance_m, "Street, stereopolis: between frames, m [4]", kStreets);
  s.add("--rig-cameras", &O::rig_cameras, "Cameras of the rig [street 4, stereopolis and target-field 10]", kRigs);
  s.add("--drives", &O::drives, "Stereopolis: drives over every street [2]", kStereopolis);
  s.add("--days", &O::days, "Stereopolis: days of the drives [2]", kStereopolis);
  s.add_switch("--no-bridge", &O::bridge, "Stereopolis: no street passes over another",
               {{"stereopolis"}, Effect::On::kTiePoints});
  s.add("--vehicle-seed", &O::vehicle_seed, "Stereopolis, target field: seed of cameras and mounts [that of --seed]",
        kVehicle);
  s.add("--panorama-radius", &O::panorama_radius_m, "Panorama: mean distance of the points, m [10]", kPanorama);
  s.add("--depth-spread", &O::depth_spread, "Panorama: distances are that, times 1 +- this [0]", kPanorama);
  s.add("--off-centre", &O::off_centre_m, "Panorama: projection centre ahead of the point it turns about, m [0]",
        kPanorama);
  s.add_switch("--vehicle", &O::vehicle, "Stereopolis, rendered: parts of the vehicle are in the images",
               {{"stereopolis"}, Effect::On::kRendered}, true);
  s.add("--repeated-facades", &O::repeated_facades,
        "Street, stereopolis, rendered: share of houses with repeated facades, 0..1 [0]",
        {kStreets.scenes, Effect::On::kRendered});
  s.add("--own-detail", &O::own_detail,
        "Courtyard, tower: share of detail that each of the four like facades has of its own, 0..1 [0.4]", kFourSides);
  s.add("--mount-position-error", &O::mount_position_error_m,
        "Stereopolis, target-field: error and sigma of the given mounts, m [0.005]", kVehicle);
  s.add("--mount-rotation-error", &O::mount_rotation_error_deg, "The same of their rotations, degrees [0.5]", kVehicle);
}

void add_observation_options(SimulateOptions& s) {
  using O = SimulationOptions;
  s.add("--points-per-frame", &O::points_per_frame,
        "Tie points: observations per frame [300; stereopolis, panorama 200, target-field 350]", kTiePoints);
  s.add("--mean-track", &O::mean_track, "Tie points: observations per point [5]", kTiePoints);
  s.add("--noise", &O::image_noise_px, "Image noise per axis, px [0.5]");
  s.add("--outliers", &O::outlier_share, "Tie points: share of outliers, 0..1 [0; stereopolis 0.03]", kTiePoints);
  s.add("--width", &O::image_width, "Image width, px [1920; courtyard, tower 800]");
  s.add("--image-height", &O::image_height,
        "Image height, px [1280; stereopolis, target-field 1080, courtyard, tower 600]");
  s.add("--focal", &O::focal_px, "Focal length, px [1400; courtyard, tower 640]");
  s.add("--camera-model", &O::camera_model,
        "All but stereopolis, target-field: camera model, as in a project file [brown]", kAnyCamera);
  s.add("--published-camera", &O::published_camera,
        "All but stereopolis, target-field: true camera of the published simulations, 1 to 4, with its size",
        kAnyCamera);
  s.add("--start-focal", &O::start_focal,
        "All but stereopolis, target-field: focal length that the block starts from, over the nominal one [1]",
        kAnyCamera);
  s.add(
      "--affinity", &O::affinity,
      "All but stereopolis, target-field: largest affinity and skew of the true camera, share of the focal length [0]",
      kAnyCamera);
  s.add("--readout-ms", &O::readout_ms,
        "Aerial, street, tie points: rolling shutter, time from the first row to the last, ms; 0 = none [0]", kMoving);
  s.add("--start-readout", &O::start_readout, "Of it: readout time that the block states, over the true one [1]",
        kMoving);
  s.add("--speed", &O::speed_mps, "Of it: speed, m/s [10]", kMoving);
  s.add_switch("--no-distortion", &O::distortion, "A camera without lens distortion");
  s.add_switch("--known-cameras", &O::free_cameras,
               "Stereopolis, target field: cameras are known and held at the truth, mounts are not", kVehicle);
  s.add_switch("--no-calibration", &O::calibrate, "Hold cameras and mounts at the truth");
}

void add_prior_options(SimulateOptions& s) {
  using O = SimulationOptions;
  s.add("--gps-sigma", &O::gps_sigma_m,
        "Position priors, m; 0 = none [0.05; stereopolis 0.02, target-field, courtyard, tower 0]");
  s.add("--gps-share", &O::gps_share, "All but stereopolis: share of frames with a position prior [1]", kNoTrajectory);
  s.add("--masked-share", &O::gnss_masked_share, "Stereopolis: share of frames with masked satellites [0.5]",
        kStereopolis);
  s.add("--absent-share", &O::gnss_absent_share, "Stereopolis: share of them without any [0.04]", kStereopolis);
  s.add("--masked-frames", &O::gnss_masked_frames, "Stereopolis: mean length of a masked stretch, frames [1500]",
        kStereopolis);
  s.add("--drift", &O::drift_m, "Stereopolis: mean largest drift of a masked stretch, m [3]", kStereopolis);
  s.add("--drift-per-frame", &O::drift_per_frame_m,
        "Stereopolis: largest change of the drift between successive frames, m [0.007]; more makes a short block drift",
        kStereopolis);
  s.add("--attitude-sigma", &O::attitude_sigma_deg,
        "Tie points: attitude priors, degrees; 0 = none [0; stereopolis 0.03]", kTiePoints);
  s.add("--lever-arm-error", &O::lever_arm_error_m,
        "All but stereopolis: distance of the antenna from its stated lever arm, m [0]", kNoTrajectory);
  s.add("--boresight-error", &O::boresight_error_deg,
        "Tie points: angle by which the attitudes are turned against the rig, degrees [0]", kTiePoints);
  s.add("--relative-position-sigma", &O::relative_position_sigma_m,
        "Relative poses, m; 0 = none [0; stereopolis 0.005]");
  s.add("--relative-rotation-sigma", &O::relative_rotation_sigma_deg, "Relative poses, degrees [0.01]");
  s.add("--start-offset", &O::start_offset_m,
        "All but stereopolis: start from the integrated relative poses, every stretch of them off by up to this, m; 0 "
        "= other start [0]",
        kNoTrajectory);
  s.add("--start-chain", &O::start_chain_frames,
        "Of --start-offset: length of these stretches, frames; 0: whole passes [0]", kNoTrajectory);
  s.add("--control-points", &O::control_points, "Control points [0; target-field 154]");
  s.add("--check-points", &O::check_points, "Check points [0; target-field 77]");
  s.add("--control-zones", &O::control_zones, "Stereopolis: crossings with 8 to 40 control and check points [0]",
        kStereopolis);
  s.add("--held-out-zone", &O::held_out_zone, "Stereopolis: zone whose points are all check points, from 0",
        kStereopolis);
  s.add("--control-sigma", &O::control_sigma_m,
        "Sigma of control points, m [0.01; stereopolis 0.015, target-field 0.002]");
}

}  // namespace

void add_simulate(CLI::App& app, Action& action) {
  CLI::App* command = app.add_subcommand("simulate", "Make a block with known truth: tie points or rendered images");
  command->footer(
      "Example: megablock simulate --scene aerial --frames 500 -o simulated\n"
      "         megablock simulate --scene stereopolis --frames 2000 --control-zones 7 -o stereopolis\n"
      "         megablock simulate --rendered --frames 24 -o rendered");
  const auto options = std::make_shared<SimulateOptions>(command);
  command->add_option("--scene", options->scene, "Scene")
      ->check(CLI::IsMember(names_in(kScenes)))
      ->capture_default_str();
  options->has_effect(command->add_option("--path", options->path, "Target field: way of the vehicle")
                          ->check(CLI::IsMember(names_in(kPaths)))
                          ->capture_default_str(),
                      kTargetField);
  command->add_flag("--rendered", options->rendered, "Render images (small blocks) instead of tie points");
  add_scene_options(*options);
  add_observation_options(*options);
  add_prior_options(*options);
  command->add_option("-o,--output", options->output, "Folder to write")->check(named())->required();
  command->add_flag("--overwrite", options->overwrite, "Overwrite a block.yaml that was edited since");
  command->add_option("--threads", options->threads, "Threads; 0 = cores of the host")->check(threads());
  command->callback([=, &action] {
    action = [options] {
      const SimulationOptions simulation = options->settled();
      simulation.check();
      check_output(options->output);
      if (options->threads > 0) omp_set_num_threads(options->threads);
      const EditedProject edited = options->overwrite ? EditedProject::kOverwrite : EditedProject::kRefuse;
      if (options->rendered)
        write_rendered_block(simulation, options->output, edited);
      else
        write_simulated_block(simulation, options->output, edited);
      std::printf("%s/block.yaml\n", options->output.c_str());
      return kExitDone;
    };
  });
}

}  // namespace megablock
