#include "io/simulate/scene/simulation_options.h"

#include <cmath>

#include "io/base/error.h"
#include "io/simulate/scene/published_cameras.h"

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

bool has_vehicle(SimulationOptions::Scene scene) {
  return scene == SimulationOptions::Scene::kStereopolis || scene == SimulationOptions::Scene::kTargetField;
}

}  // namespace

SimulationOptions SimulationOptions::of(Scene scene, Path path) {
  SimulationOptions options;
  options.scene = scene;
  options.path = path;
  if (scene == Scene::kAerial || scene == Scene::kStreet) return options;
  if (scene == Scene::kCourtyard || scene == Scene::kTower) {
    options.frames = 24;
    options.image_width = 800;
    options.image_height = 600;
    options.focal_px = 640;
    options.gps_sigma_m = 0;
    options.start_position_error_m = -1;
    return options;
  }
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
  require_option(affinity >= 0 && affinity < 0.1, "affinity must lie in [0, 0.1)");
  require_option(affinity == 0 || (camera_model == model_name(CameraModel()) && published_camera == 0),
                 "affinity needs the camera model brown");
  require_option(std::abs(readout_ms) <= 1000, "readout_ms must lie in [-1000, 1000]");
  require_option(readout_ms == 0 || scene == Scene::kAerial || scene == Scene::kStreet,
                 "readout_ms is for the scenes aerial and street");
  require_option(start_readout >= 0 && start_readout * std::abs(readout_ms) <= 1000,
                 "start_readout must be at least 0, and start_readout times readout_ms at most 1000");
  require_option(speed_mps > 0 && speed_mps <= 1000, "speed_mps must lie in (0, 1000]");
  require_option(start_focal > 0.2 && start_focal < 5, "start_focal must lie in (0.2, 5)");
  require_option(published_camera == 0 || !has_vehicle(scene),
                 "published_camera is not for scenes with the vehicle's rig");
  require_option(repeated_facades >= 0 && repeated_facades <= 1, "repeated_facades must lie in [0, 1]");
  require_option(own_detail >= 0 && own_detail <= 1, "own_detail must lie in [0, 1]");
  require_option(!vehicle || scene == Scene::kStereopolis, "a vehicle is seen in the stereopolis scene only");
  require_option(points_per_frame >= 10 && points_per_frame <= kMostPoints, "points_per_frame must lie in [10, 1e6]");
  require_option(mean_track >= 2 && mean_track <= 30, "mean_track must lie in [2, 30]");
  require_option(image_noise_px >= 0 && image_noise_px < 50, "image_noise_px must lie in [0, 50)");
  require_option(outlier_share >= 0 && outlier_share < 1, "the share of outliers must lie in [0, 1)");
  require_option(gps_share >= 0 && gps_share <= 1, "gps_share must lie in [0, 1]");
  require_option(std::abs(gps_sigma_m) <= kFarthest_m, "gps_sigma_m must be at most 1e5");
  require_option(std::abs(lever_arm_error_m) <= 1000, "lever_arm_error_m must be at most 1000");
  require_option(std::abs(boresight_error_deg) <= 180, "boresight_error_deg must be at most 180");
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

}  // namespace megablock
