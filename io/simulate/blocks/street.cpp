// Simulates a street block: a rig with cameras in all directions drives twice over a grid of streets (drive.h,
// street_scene.h).
//
// A place on the road at the arc length s of the drive lies kLane to the right of the street axis: (x, y) = p(s) +
// (kLane + 0.1 n) right, with the rig kRigHeight above it. A frame deviates by normal errors of 10 cm across, 2 cm in
// height, 0.5 degrees about the axes east and north, and 1 degree in heading.
#include "io/simulate/blocks/street.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "geometry/numbers/angles.h"
#include "io/simulate/streets/drive.h"
#include "io/simulate/streets/street_scene.h"

namespace megablock {

namespace {

// The rig axes are x right, y down, z forward. The cameras look horizontally in equally spaced directions, the first
// one forward.
Pose mount_pose(const SimulationOptions& options, int camera) {
  Random random(options.seed, Random::Purpose::kCamera, 1000 + static_cast<std::uint64_t>(camera));
  const double yaw = 2 * std::numbers::pi * camera / options.rig_cameras;
  Eigen::Matrix3d r;
  r.row(0) << std::cos(yaw), 0, -std::sin(yaw);
  r.row(1) << 0, 1, 0;
  r.row(2) << std::sin(yaw), 0, std::cos(yaw);
  Pose mount;
  mount.rotation = rotation_update(Eigen::Quaterniond(r).normalized(), 0.5 * kDegree * random.normal3());
  mount.centre = Eigen::Vector3d(0.25 * std::sin(yaw), 0, 0.25 * std::cos(yaw)) + 0.03 * random.normal3();
  return mount;
}

void add_drive(const SimulationOptions& options, const StreetScene& scene, const Drive& drive, std::int64_t pass,
               std::int64_t frames, Layout& layout) {
  for (std::int64_t i = 0; i < frames; ++i) {
    const auto index = static_cast<std::uint64_t>(layout.block.frames.size());
    Random random(options.seed, Random::Purpose::kFrame, index);
    // The second drive goes in the opposite direction and has other places.
    double s = options.frame_distance_m * (static_cast<double>(i) + random.uniform(-0.1, 0.1));
    const double turn = pass == 0 ? 1 : -1;
    if (pass == 1) s = options.frame_distance_m * (static_cast<double>(frames) - 0.5) - s;
    s = std::clamp(s, 0.0, drive.length());
    const Eigen::Vector2d forward = turn * drive.forward(s);
    const Eigen::Vector2d right(forward.y(), -forward.x());
    const Eigen::Vector2d place = drive.at(s) + (kLane + 0.1 * random.normal()) * right;
    Pose pose;
    pose.centre << place, scene.ground(place.x(), place.y()) + kRigHeight + 0.02 * random.normal();
    pose.rotation =
        rotation_update(level_rotation(forward), kDegree * Eigen::Vector3d(0.5, 0.5, 1).cwiseProduct(random.normal3()));
    // A million seconds lie between the drives, so that times of different drives are far from each other (unless a
    // drive has a million frames).
    add_simulated_frame(layout, pose, pass, static_cast<double>(i) + 1e6 * static_cast<double>(pass));
  }
}

}  // namespace

Layout make_street_layout(const SimulationOptions& options) {
  Layout layout;
  Rig rig;
  rig.name = "rig0";
  std::vector<Pose> mounts;
  for (int c = 0; c < options.rig_cameras; ++c) {
    const CameraIndex camera = add_simulated_camera(options, layout);
    mounts.push_back(mount_pose(options, c));
    rig.mounts.push_back({camera, mounts.back(), 0, 0});
  }
  layout.block.rigs.push_back(std::move(rig));
  layout.truth.mounts.push_back(std::move(mounts));

  auto scene = std::make_unique<StreetScene>(options, street_terrain(options));
  const std::int64_t first = (options.frames + 1) / 2;
  const double needed = options.frame_distance_m * static_cast<double>(first);
  std::int64_t streets = 2;
  // The smallest grid that is longer than the first drive.
  while (Drive(drive_corners(streets, options.street_spacing_m)).length() < needed) ++streets;
  const Drive drive(drive_corners(streets, options.street_spacing_m));
  add_drive(options, *scene, drive, 0, first, layout);
  add_drive(options, *scene, drive, 1, options.frames - first, layout);
  layout.scene = std::move(scene);
  return layout;
}

}  // namespace megablock
