#include "io/simulate/blocks/vehicle.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "geometry/numbers/angles.h"

namespace megablock {

namespace {

// The place of a camera in the rig. The rig axes are x right, y down, z ahead; yaw is to the right, pitch upwards.
struct VehiclePlacing {
  int id;
  double yaw_deg, pitch_deg;
  Eigen::Vector3d centre;  // metres
};

// The cameras of the head stand on a circle of 0.25 m about its axis.
Eigen::Vector3d on_head(double yaw_deg, double up) {
  return {0.25 * std::sin(kDegree * yaw_deg), -up, 0.25 * std::cos(kDegree * yaw_deg)};
}

// The cameras in the order in which larger rigs add them.
std::vector<VehiclePlacing> places() {
  const auto head = [](int id, double yaw, double pitch) {
    return VehiclePlacing{id, yaw, pitch, on_head(yaw, pitch > 0 ? 0.15 : 0)};
  };
  return {head(22, 0, 0),
          head(42, 180, 0),
          head(31, -90, 0),
          head(32, 90, 0),
          head(21, -45, 0),
          head(23, 45, 0),
          head(41, -135, 0),
          head(43, 135, 0),
          head(33, -90, 50),
          head(34, 90, 50),
          {11, 0, 0, {-0.6, 0.5, 0.8}},
          {12, 0, 0, {0.6, 0.5, 0.8}},
          {51, 180, 0, {0.6, 0.5, -0.8}},
          {52, 180, 0, {-0.6, 0.5, -0.8}},
          {61, -90, -20, {-0.6, 0.5, 0}},
          {62, 90, -20, {0.6, 0.5, 0}}};
}

Pose nominal_mount(const VehiclePlacing& place) {
  const double yaw = kDegree * place.yaw_deg, pitch = kDegree * place.pitch_deg;
  // The rows of R are the axes of the camera in axes of the rig; down = ahead x right.
  const Eigen::Vector3d right(std::cos(yaw), 0, -std::sin(yaw));
  // x right, y down, z ahead: a turn to the right moves z towards x, an upward pitch moves it towards -y.
  const Eigen::Vector3d ahead(std::sin(yaw) * std::cos(pitch), -std::sin(pitch), std::cos(yaw) * std::cos(pitch));
  Eigen::Matrix3d r;
  r << right.transpose(), ahead.cross(right).transpose(), ahead.transpose();
  return {Eigen::Quaterniond(r).normalized(), place.centre};
}

// Adds camera 3 of the thesis (HD, f = 1400 px): principal point (961, 542) and up to 14 px of distortion at the edge,
// here in Brown's model. The initial values of the block come from a laboratory calibration with errors of 0.1 % of the
// focal length, one pixel of the principal point, and about one pixel of the distortion at the edge.
CameraIndex add_camera(const SimulationOptions& options, const std::string& name, Random& random, Layout& layout) {
  const CameraIndex index = layout.block.cameras.next_index();
  Camera camera;
  camera.name = name;
  camera.width = options.image_width;
  camera.height = options.image_height;
  camera.focal_known = true;
  camera.intrinsics = {options.focal_px, options.image_width / 2.0 + 1, options.image_height / 2.0 + 2, 0, 0, 0, 0, 0};
  if (options.distortion) {
    camera.intrinsics[kRadial1] = 0.09;
    camera.intrinsics[kRadial2] = -0.095;
  }
  Intrinsics truth = camera.intrinsics;
  truth[kFocal] *= 1 + 0.001 * random.normal();
  truth[kPrincipalX] += random.normal();
  truth[kPrincipalY] += random.normal();
  if (options.distortion) {
    truth[kRadial1] += 0.002 * random.normal();
    truth[kRadial2] += 0.002 * random.normal();
    truth[kDecentring1] = 1e-4 * random.normal();
    truth[kDecentring2] = 1e-4 * random.normal();
  }
  if (options.calibrate && options.free_cameras) {
    std::fill_n(camera.prior_sigma.begin(), kDecentring2 + 1, std::numeric_limits<double>::infinity());
    camera.prior_sigma[kRadial3] = 0;
  } else {
    camera.intrinsics = truth;
  }
  layout.block.cameras.push_back(camera);
  layout.truth.cameras.push_back(truth);
  return index;
}

}  // namespace

void add_vehicle(const SimulationOptions& options, Layout& layout) {
  std::vector<VehiclePlacing> chosen = places();
  chosen.resize(static_cast<std::size_t>(options.rig_cameras));
  std::sort(chosen.begin(), chosen.end(), [](const VehiclePlacing& a, const VehiclePlacing& b) { return a.id < b.id; });
  Rig rig;
  rig.name = "stereopolis";
  std::vector<Pose> truth;
  for (const VehiclePlacing& place : chosen) {
    std::string name("c");
    name.append(std::to_string(place.id));
    // Each camera has a stream by its name, so that a smaller rig is a part of a larger one.
    Random random(options.vehicle_seed ? options.vehicle_seed : options.seed, Random::Purpose::kCamera,
                  2000 + static_cast<std::uint64_t>(place.id));
    Mount mount;
    mount.pose = nominal_mount(place);
    Pose real = mount.pose;
    // Drawn also for the first mount, so that its camera stays the same in any rig.
    const Eigen::Vector3d shift = random.normal3(), turn = random.normal3();
    if (!rig.mounts.empty()) {
      real.centre += options.mount_position_error_m * shift;
      real.rotation = rotation_update(real.rotation, kDegree * options.mount_rotation_error_deg * turn);
      if (options.calibrate) {
        mount.position_sigma_m = options.mount_position_error_m;
        mount.rotation_sigma_rad = kDegree * options.mount_rotation_error_deg;
      } else {
        mount.pose = real;
      }
    }
    mount.camera = add_camera(options, name, random, layout);
    rig.mounts.push_back(mount);
    truth.push_back(real);
    layout.image_suffixes.push_back("_" + name);
  }
  layout.block.rigs.push_back(std::move(rig));
  layout.truth.mounts.push_back(std::move(truth));
}

}  // namespace megablock
