// The order of the parts is fixed: layout (cameras, mounts, poses), control points, tie points, priors. Each draws from
// streams of its own, so that an option of one part leaves the others as they are.
#include "io/simulate/blocks/simulate.h"

#include <cmath>
#include <iomanip>
#include <limits>
#include <sstream>

#include "io/base/error.h"
#include "io/simulate/blocks/panorama.h"
#include "io/simulate/scene/scene.h"
#include "io/simulate/scene/trajectory.h"

namespace megablock {

namespace {

// Larger values are typing errors, and calculations with them would lose digits.
constexpr std::int64_t kMostFrames = 100'000'000;
constexpr double kFarthest_m = 100e3, kHighestRelief_m = 10e3;
constexpr int kMostPixels = 100'000;  // per side
constexpr int kMostPoints = 1'000'000;

void require_option(bool condition, const std::string& message) {
  if (!condition) throw InputError("simulation: " + message);
}

std::string frame_name(std::int64_t index) {
  std::ostringstream name;
  name << 'f' << std::setw(6) << std::setfill('0') << index;
  return name.str();
}

bool has_vehicle(SimulationOptions::Scene scene) {
  return scene == SimulationOptions::Scene::kStereopolis || scene == SimulationOptions::Scene::kTargetField;
}

}  // namespace

SimulationOptions SimulationOptions::of(Scene scene, Path path) {
  SimulationOptions options;
  options.scene = scene;
  options.path = path;
  if (scene == Scene::kAerial || scene == Scene::kStreet) return options;
  if (scene == Scene::kPanorama) {
    options.frames = 42;
    options.points_per_frame = 200;
    options.gps_sigma_m = 0;
    options.start_position_error_m = -1;
    return options;
  }
  options.rig_cameras = 10;
  options.image_height = 1080;
  options.points_per_frame = 200;
  if (scene == Scene::kStereopolis) {
    options.frames = 800;
    options.outlier_share = 0.03;
    options.gps_sigma_m = 0.02;
    options.attitude_sigma_deg = 0.03;
    options.relative_position_sigma_m = 0.005;
    options.control_sigma_m = 0.015;
  } else {
    const bool sparse = path == Path::kSparse;
    options.frames = sparse ? 4 : 30;
    options.points_per_frame = sparse ? 20 : 350;
    options.gps_sigma_m = 0;
    options.start_position_error_m = 0.2;
    options.control_points = sparse ? 10 : 154;
    options.check_points = sparse ? 5 : 77;
    options.control_sigma_m = 0.002;
  }
  return options;
}

void SimulationOptions::use_published_camera(int number) {
  const auto count = static_cast<int>(published_cameras().size());
  require_option(number >= 1 && number <= count, "published_camera must lie in [1, " + std::to_string(count) + "]");
  const PublishedCamera& camera = published_cameras()[static_cast<std::size_t>(number - 1)];
  published_camera = number;
  image_width = camera.width;
  image_height = camera.height;
  focal_px = camera.truth[kFocal];
}

void SimulationOptions::check() const {
  require_option(frames >= 2, "frames must be at least 2");
  require_option(frames <= kMostFrames, "frames must be at most 1e8");
  require_option(forward_overlap >= 0.3 && forward_overlap < 0.99, "forward_overlap must lie in [0.3, 0.99)");
  require_option(side_overlap >= 0 && side_overlap < 0.99, "side_overlap must lie in [0, 0.99)");
  require_option(height_m > 0 && height_m <= kFarthest_m, "height_m must lie in (0, 1e5]");
  require_option(terrain_relief_m >= 0 && terrain_relief_m <= kHighestRelief_m,
                 "terrain_relief_m must lie in [0, 1e4]");
  require_option(scene != Scene::kAerial || terrain_relief_m <= height_m, "terrain_relief_m must lie in [0, height_m]");
  require_option(street_spacing_m >= 40 && street_spacing_m <= kFarthest_m, "street_spacing_m must lie in [40, 1e5]");
  require_option(frame_distance_m > 0 && frame_distance_m <= 15, "frame_distance_m must lie in (0, 15]");
  require_option(rig_cameras >= 1 && rig_cameras <= 16, "rig_cameras must lie in [1, 16]");
  require_option(drives >= 1 && drives <= 100, "drives must lie in [1, 100]");
  require_option(days >= 1 && days <= drives, "days must lie in [1, drives]");
  require_option(scene != Scene::kStereopolis || frames >= 2 * drives, "frames must be at least 2 per drive");
  require_option(gnss_masked_share >= 0 && gnss_masked_share < 1, "gnss_masked_share must lie in [0, 1)");
  require_option(gnss_absent_share >= 0 && gnss_absent_share <= gnss_masked_share,
                 "gnss_absent_share must lie in [0, gnss_masked_share]");
  require_option(gnss_masked_frames >= 1, "gnss_masked_frames must be at least 1");
  require_option(drift_m >= 0 && drift_m <= kFarthest_m, "drift_m must lie in [0, 1e5]");
  require_option(drift_per_frame_m > 0 && drift_per_frame_m <= kFarthest_m, "drift_per_frame_m must lie in (0, 1e5]");
  require_option(control_zones >= 0 && control_zones <= kMostPoints, "control_zones must lie in [0, 1e6]");
  require_option(held_out_zone == -1 || (held_out_zone >= 0 && held_out_zone < control_zones),
                 "held_out_zone must be -1 or one of the control zones, counted from 0");
  require_option(scene != Scene::kStereopolis || outlier_share <= 0.4,
                 "the share of outliers in this scene must lie in [0, 0.4]");
  require_option(control_zones == 0 || scene == Scene::kStereopolis,
                 "control_zones are those of the stereopolis scene");
  require_option(mount_position_error_m >= 0 && mount_position_error_m <= 10,
                 "mount_position_error_m must lie in [0, 10]");
  require_option(mount_rotation_error_deg >= 0 && mount_rotation_error_deg < 10,
                 "mount_rotation_error_deg must lie in [0, 10)");
  require_option(panorama_radius_m > 0 && panorama_radius_m <= kFarthest_m, "panorama_radius_m must lie in (0, 1e5]");
  require_option(depth_spread >= 0 && depth_spread < 0.9, "depth_spread must lie in [0, 0.9)");
  require_option(std::abs(off_centre_m) < 0.05 * panorama_radius_m,
                 "off_centre_m must be below 5 % of panorama_radius_m");
  require_option(start_focal > 0.2 && start_focal < 5, "start_focal must lie in (0.2, 5)");
  require_option(published_camera == 0 || !has_vehicle(scene),
                 "published_camera is not for scenes with the vehicle's rig");
  require_option(repeated_facades >= 0 && repeated_facades <= 1, "repeated_facades must lie in [0, 1]");
  require_option(!vehicle || scene == Scene::kStereopolis, "a vehicle is seen in the stereopolis scene only");
  require_option(points_per_frame >= 10 && points_per_frame <= kMostPoints, "points_per_frame must lie in [10, 1e6]");
  require_option(mean_track >= 2 && mean_track <= 30, "mean_track must lie in [2, 30]");
  require_option(image_noise_px >= 0 && image_noise_px < 50, "image_noise_px must lie in [0, 50)");
  require_option(outlier_share >= 0 && outlier_share < 1, "the share of outliers must lie in [0, 1)");
  require_option(gps_share >= 0 && gps_share <= 1, "gps_share must lie in [0, 1]");
  require_option(std::abs(gps_sigma_m) <= kFarthest_m, "gps_sigma_m must be at most 1e5");
  require_option(std::abs(attitude_sigma_deg) <= 180, "attitude_sigma_deg must be at most 180");
  require_option(std::abs(relative_position_sigma_m) <= kFarthest_m, "relative_position_sigma_m must be at most 1e5");
  require_option(std::abs(relative_rotation_sigma_deg) <= 180, "relative_rotation_sigma_deg must be at most 180");
  require_option(relative_position_sigma_m <= 0 || relative_rotation_sigma_deg > 0,
                 "relative_rotation_sigma_deg must be positive with relative_position_sigma_m");
  require_option(start_offset_m >= 0 && start_offset_m <= kFarthest_m,
                 "start_offset_m (--start-offset) must lie in [0, 1e5]");
  require_option(
      start_offset_m == 0 || (relative_position_sigma_m > 0 && scene != Scene::kStereopolis),
      "start_offset_m (--start-offset) needs relative poses to integrate (--relative-position-sigma) and another scene "
      "than stereopolis");
  require_option(start_chain_frames == 0 || start_chain_frames >= 2,
                 "start_chain_frames (--start-chain) must be at least 2, or 0 for whole passes");
  require_option(start_chain_frames == 0 || start_offset_m > 0,
                 "start_chain_frames (--start-chain) has no effect without start_offset_m (--start-offset)");
  require_option(control_points >= 0 && control_points <= kMostPoints, "control_points must lie in [0, 1e6]");
  require_option(check_points >= 0 && check_points <= kMostPoints, "check_points must lie in [0, 1e6]");
  require_option(control_sigma_m > 0 && control_sigma_m <= kFarthest_m, "control_sigma_m must lie in (0, 1e5]");
  require_option(image_width >= 64, "image_width must be at least 64 px");
  require_option(image_height >= 64, "image_height must be at least 64 px");
  require_option(std::max(image_width, image_height) <= kMostPixels,
                 "image_width and image_height must be at most 1e5 px");
  const auto model = find_model(camera_model);
  require_option(model.has_value(), "camera_model '" + camera_model + "' is not one of: " + model_list());
  require_option(
      focal_px >= 0.3 * std::max(image_width, image_height) && focal_px <= 100.0 * std::max(image_width, image_height),
      "focal_px must lie in [0.3, 100] times the larger side");
}

CameraIndex add_single_camera_rig(const SimulationOptions& options, Layout& layout) {
  const CameraIndex camera = add_simulated_camera(options, layout);
  Rig rig;
  rig.name = "rig0";
  rig.mounts.push_back({camera, Pose(), 0, 0});
  layout.block.rigs.push_back(rig);
  layout.truth.mounts.push_back({Pose()});
  return camera;
}

CameraIndex add_simulated_camera(const SimulationOptions& options, Layout& layout) {
  const CameraIndex index = layout.block.cameras.next_index();
  Random random(options.seed, Random::Purpose::kCamera, static_cast<std::uint64_t>(index.value));
  Camera camera;
  camera.name.append("camera").append(std::to_string(index.value));
  camera.width = options.image_width;
  camera.height = options.image_height;
  camera.focal_known = true;
  const CameraModel model = find_model(options.camera_model).value();
  camera.intrinsics = start_intrinsics(model, options.focal_px, options.image_width, options.image_height);

  Intrinsics truth = camera.intrinsics;
  // Only the initial value changes, not the truth.
  if (!is_fixed(model, kFocal)) camera.intrinsics[kFocal] *= options.start_focal;
  const IntrinsicSigmas weak = weak_sigmas(truth, 0.01 * options.focal_px, options.image_width);
  const auto estimated = [&](int parameter) { return weak[static_cast<std::size_t>(parameter)] > 0; };
  if (options.calibrate) {
    // Errors of up to 0.3 % of the focal length. Each parameter that the model fixes keeps its value.
    if (estimated(kFocal)) truth[kFocal] *= 1 + 0.003 * random.uniform(-1, 1);
    if (estimated(kPrincipalX)) truth[kPrincipalX] += 0.003 * options.focal_px * random.uniform(-1, 1);
    truth[kPrincipalY] += 0.003 * options.focal_px * random.uniform(-1, 1);
  }
  if (options.distortion && model != CameraModel()) {
    constexpr double kShare = 0.15;  // errors of the true camera, as a share of the weak prior sigmas
    // The weak sigmas have the unit and size that each parameter needs, so one share serves all models.
    for (int p = kPrincipalY + 1; p < truth.size(); ++p)
      truth[p] += kShare * weak[static_cast<std::size_t>(p)] * random.uniform(-1, 1);
  } else if (options.distortion) {
    truth[kRadial1] = random.uniform(-0.04, -0.02);
    truth[kRadial2] = random.uniform(0.005, 0.012);
    truth[kDecentring1] = random.uniform(-4e-4, 4e-4);
    truth[kDecentring2] = random.uniform(-4e-4, 4e-4);
  }
  if (options.published_camera > 0)
    truth = published_cameras()[static_cast<std::size_t>(options.published_camera - 1)].truth;
  if (options.calibrate) {
    constexpr double kFree = std::numeric_limits<double>::infinity();
    // The true Brown camera has no k3, so k3 is held at zero.
    if (model == CameraModel())
      camera.prior_sigma = {kFree, kFree, kFree, kFree, kFree, 0, kFree, kFree};
    else
      camera.prior_sigma = weak;
  } else {
    camera.intrinsics = truth;
  }
  layout.block.cameras.push_back(camera);
  layout.truth.cameras.push_back(truth);
  return index;
}

void add_simulated_frame(Layout& layout, const Pose& pose, std::int64_t pass, double time_s) {
  const FrameIndex index = layout.block.frames.next_index();
  const RigIndex rig(0);
  const std::size_t cameras = layout.block.rigs[rig].mounts.size();
  Frame frame;
  frame.name = frame_name(index.value);
  frame.rig = rig;
  frame.pass = pass;
  // Seconds since 1970: the block was taken in September 2020. A plausible time is needed for EXIF.
  frame.time_s = 1.6e9 + time_s;
  for (std::size_t m = 0; m < cameras; ++m) {
    std::string name = frame.name;
    if (!layout.image_suffixes.empty())
      name.append(layout.image_suffixes[m]);
    else if (cameras > 1)
      name.append("_c").append(std::to_string(m));
    layout.block.add_image(name.append(".jpg"), {index, static_cast<int>(m), 0});
  }
  if (cameras == 1) frame.name += ".jpg";  // the frame of a single image has the name of this image
  layout.block.frames.push_back(std::move(frame));
  layout.truth.frames.push_back(pose);
  layout.truth.oriented.push_back(1);
}

Layout make_layout(const SimulationOptions& options) {
  switch (options.scene) {
    case SimulationOptions::Scene::kAerial:
      return make_aerial_layout(options);
    case SimulationOptions::Scene::kStreet:
      return make_street_layout(options);
    case SimulationOptions::Scene::kStereopolis:
      return make_stereopolis_layout(options);
    case SimulationOptions::Scene::kPanorama:
      return make_panorama_layout(options);
    case SimulationOptions::Scene::kTargetField:
      break;
  }
  return make_target_field_layout(options);
}

void simulate_given(const SimulationOptions& options, SimulatedBlock& simulated) {
  if (options.scene == SimulationOptions::Scene::kStereopolis)
    simulate_trajectory(options, simulated);
  else
    simulate_priors(options, simulated);
}

SimulatedBlock simulate_block(const SimulationOptions& options, const TrackSink& sink,
                              std::int64_t batch_observations) {
  options.check();
  Layout layout = make_layout(options);
  // Without positions and control the job has nothing that ties it to the earth. A ground frame that claims this would
  // be wrong.
  layout.block.ground.georeferenced =
      options.gps_sigma_m > 0 || options.control_points > 0 || options.control_zones > 0;
  if (layout.block.ground.georeferenced) layout.block.ground = {true, 48.85, 2.35, 100, "EPSG:4326"};

  SimulatedBlock simulated;
  simulated.tracks.begin = {0};
  {
    const Observer observer(layout, image_margin(options));
    simulate_control_zones(options, observer, layout);
    simulate_control(options, observer, layout);
    simulate_tracks(options, layout, observer, sink, batch_observations);
  }
  simulated.block = std::move(layout.block);
  simulated.truth = std::move(layout.truth);
  simulated.control_truth = std::move(layout.control_truth);
  simulate_given(options, simulated);
  check(simulated.block);
  return simulated;
}

SimulatedBlock simulate_block(const SimulationOptions& options) {
  SimulatedTracks all;
  all.tracks.begin = {0};
  SimulatedBlock simulated =
      simulate_block(options, [&](const SimulatedTracks& batch) { append_tracks(all, batch, 0, batch.points.size()); });
  static_cast<SimulatedTracks&>(simulated) = std::move(all);
  return simulated;
}

}  // namespace megablock
