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

constexpr double kRounded = 5;  // metres: ends of a drive whose places cannot be rounded off

// The same drive with a rolling shutter: without scatter of the places and at a constant speed, on a path whose corners
// are rounded off as its directions are, so that it has a velocity.
void add_smooth_drive(const SimulationOptions& options, const StreetScene& scene, const Drive& drive, std::int64_t pass,
                      std::int64_t frames, Layout& layout) {
  const double turn = pass == 0 ? 1 : -1;
  const auto start = static_cast<double>(frames) - 0.5;
  const auto forward_at = [&](double t) -> Eigen::Vector2d {
    const double way = options.speed_mps * t;
    return turn * drive.forward(pass == 0 ? kRounded + way : kRounded + options.frame_distance_m * start - way);
  };
  const auto place_at = [&](double t) -> Eigen::Vector3d {
    const double way = options.speed_mps * t;
    const Eigen::Vector2d forward = forward_at(t), right(forward.y(), -forward.x());
    const Eigen::Vector2d place =
        drive.rounded_at(pass == 0 ? kRounded + way : kRounded + options.frame_distance_m * start - way) +
        kLane * right;
    return {place.x(), place.y(), scene.ground(place.x(), place.y()) + kRigHeight};
  };
  for (std::int64_t i = 0; i < frames; ++i) {
    Random random(options.seed, Random::Purpose::kFrame, static_cast<std::uint64_t>(layout.block.frames.size()));
    const double t = static_cast<double>(i) * options.frame_distance_m / options.speed_mps;
    constexpr double kStepS = 1e-3;
    const Eigen::Vector2d before = forward_at(t - kStepS), after = forward_at(t + kStepS);
    const double turned = std::atan2(before.x() * after.y() - before.y() * after.x(), before.dot(after));
    const Motion motion{(place_at(t + kStepS) - place_at(t - kStepS)) / (2 * kStepS), {0, 0, turned / (2 * kStepS)}};
    const Eigen::Quaterniond rotation = rotation_update(
        level_rotation(forward_at(t)), kDegree * Eigen::Vector3d(0.5, 0.5, 1).cwiseProduct(random.normal3()));
    add_simulated_frame(layout, {rotation, place_at(t)}, pass, t + 1e6 * static_cast<double>(pass), motion);
  }
}

void add_drive(const SimulationOptions& options, const StreetScene& scene, const Drive& drive, std::int64_t pass,
               std::int64_t frames, Layout& layout) {
  if (options.readout_ms != 0) return add_smooth_drive(options, scene, drive, pass, frames, layout);
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
  const double needed =
      options.frame_distance_m * static_cast<double>(first) + (options.readout_ms != 0 ? 2 * kRounded : 0);
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
