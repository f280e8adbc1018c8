// Street block: a grid of streets driven twice by a rig of cameras around the compass.
//
// A drive follows the streets in serpentines, first those along x, then those along y (street_grid.h).
#include <algorithm>
#include <cmath>
#include <numbers>

#include "io/simulate/scene.h"
#include "io/simulate/street_grid.h"

namespace megablock {

namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kFacadeHeight = 12;
constexpr double kCamera = 2.5;  // height of the rig above the road
constexpr double kRange = 40;
constexpr double kLane = 1.75;  // a drive keeps to the right of the axis

class StreetScene : public Scene {
 public:
  explicit StreetScene(const SimulationOptions& options)
      : spacing_(options.street_spacing_m), seed_(options.seed), terrain_(street_terrain(options)) {}

  double ground(double x, double y) const { return terrain_.height(x, y); }

  // A place on the road or on a facade within kRange along the frame's street.
  std::optional<SurfacePoint> sample(const Pose& frame, Random& random) const override {
    const bool street_along_x = off_axis(frame.centre.y(), spacing_) < off_axis(frame.centre.x(), spacing_);
    const int along = street_along_x ? 0 : 1, across = 1 - along;
    const std::int64_t street = nearest_axis(frame.centre[across], spacing_);
    const double axis = spacing_ * static_cast<double>(street);
    const double place = frame.centre[along] + random.uniform(-0.6, 0.6) * kRange;
    const int side = random.uniform() < 0.5 ? -1 : 1;
    const bool road = random.uniform() < 0.3;
    SurfacePoint point;
    point.position[along] = place;
    point.normal.setZero();
    if (road) {
      point.position[across] = axis + side * random.uniform(3.5, kFacade - kFacadeDepth);
      point.normal.z() = 1;
    } else {
      if (off_axis(place, spacing_) < kFacade + kFacadeDepth) return std::nullopt;  // a crossing
      point.position[across] = axis + side * facade_distance(seed_, street_along_x, street, side, place);
      point.normal[across] = -side;
    }
    point.position.z() = ground(point.position.x(), point.position.y());
    if (!road) point.position.z() += random.uniform(0, kFacadeHeight);
    return point;
  }

  // Within range, not too flat, and the line of sight stays over the streets.
  bool visible(const Eigen::Vector3d& eye, const SurfacePoint& point) const override {
    const Eigen::Vector3d sight = point.position - eye;
    const double distance = sight.norm();
    if (distance > kRange || distance < 2 || -sight.dot(point.normal) < 0.12 * distance) return false;
    for (const int across : {0, 1})  // both ends in one street
      if (nearest_axis(eye[across], spacing_) == nearest_axis(point.position[across], spacing_) &&
          std::max(off_axis(eye[across], spacing_), off_axis(point.position[across], spacing_)) <=
              kFacade + kFacadeDepth)
        return true;
    constexpr int kSteps = 12;
    for (int i = 1; i < kSteps; ++i) {
      const Eigen::Vector3d place = eye + sight * (static_cast<double>(i) / kSteps);
      if (std::min(off_axis(place.x(), spacing_), off_axis(place.y(), spacing_)) > kFacade + kFacadeDepth) return false;
    }
    return true;
  }
  double range_m() const override { return kRange; }
  bool along_passes() const override { return true; }

 private:
  double spacing_;
  std::uint64_t seed_;
  Terrain terrain_;
};

// The corners of a drive over streets 0..streets-1 of both directions.
std::vector<Eigen::Vector2d> drive_corners(std::int64_t streets, double spacing) {
  const double far = static_cast<double>(streets - 1) * spacing;
  std::vector<Eigen::Vector2d> corners;
  for (std::int64_t j = 0; j < streets; ++j) {
    const double y = static_cast<double>(j) * spacing;
    corners.emplace_back(j % 2 == 0 ? 0 : far, y);
    corners.emplace_back(j % 2 == 0 ? far : 0, y);
  }
  // Continue from the corner reached; the serpentine along y starts at its x side, at the far y.
  const bool from_far = streets % 2 == 1;
  for (std::int64_t i = 0; i < streets; ++i) {
    const double column = static_cast<double>(i) * spacing, x = from_far ? far - column : column;
    corners.emplace_back(x, i % 2 == 0 ? far : 0);
    corners.emplace_back(x, i % 2 == 0 ? 0 : far);
  }
  return corners;
}

// Polyline addressed by arc length.
class Drive {
 public:
  explicit Drive(std::vector<Eigen::Vector2d> corners) : corners_(std::move(corners)), length_{0} {
    for (std::size_t i = 1; i < corners_.size(); ++i)
      length_.push_back(length_.back() + (corners_[i] - corners_[i - 1]).norm());
  }
  double length() const { return length_.back(); }
  Eigen::Vector2d at(double s) const {
    s = std::clamp(s, 0.0, length());
    const auto next = std::upper_bound(length_.begin() + 1, length_.end() - 1, s);
    const auto i = static_cast<std::size_t>(next - length_.begin());
    const double part = length_[i] - length_[i - 1];
    return part > 0 ? Eigen::Vector2d(corners_[i - 1] + (corners_[i] - corners_[i - 1]) * ((s - length_[i - 1]) / part))
                    : corners_[i];
  }

 private:
  std::vector<Eigen::Vector2d> corners_;
  std::vector<double> length_;
};

// Rig axes: x right, y down, z forward. Cameras look horizontally around the compass, the first one forward.
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

// Level rig at a place of the drive, heading along `forward`.
Eigen::Quaterniond level_rotation(const Eigen::Vector2d& forward) {
  Eigen::Matrix3d r;
  r.row(0) << forward.y(), -forward.x(), 0;
  r.row(1) << 0, 0, -1;
  r.row(2) << forward.x(), forward.y(), 0;
  return Eigen::Quaterniond(r).normalized();
}

void add_drive(const SimulationOptions& options, const StreetScene& scene, const Drive& drive, std::int64_t pass,
               std::int64_t frames, Layout& layout) {
  for (std::int64_t i = 0; i < frames; ++i) {
    const auto index = static_cast<std::uint64_t>(layout.block.frames.size());
    Random random(options.seed, Random::Purpose::kFrame, index);
    // The second drive goes the other way, at places of its own.
    double s = options.frame_distance_m * (static_cast<double>(i) + random.uniform(-0.1, 0.1));
    const double turn = pass == 0 ? 1 : -1;
    if (pass == 1) s = options.frame_distance_m * (static_cast<double>(frames) - 0.5) - s;
    s = std::clamp(s, 0.0, drive.length());
    const Eigen::Vector2d forward = turn * (drive.at(s + 5) - drive.at(s - 5)).normalized();
    const Eigen::Vector2d right(forward.y(), -forward.x());
    const Eigen::Vector2d place = drive.at(s) + (kLane + 0.1 * random.normal()) * right;
    Pose pose;
    pose.centre << place, scene.ground(place.x(), place.y()) + kCamera + 0.02 * random.normal();
    pose.rotation =
        rotation_update(level_rotation(forward), kDegree * Eigen::Vector3d(0.5, 0.5, 1).cwiseProduct(random.normal3()));
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

  auto scene = std::make_unique<StreetScene>(options);
  const std::int64_t first = (options.frames + 1) / 2;
  const double needed = options.frame_distance_m * static_cast<double>(first);
  std::int64_t streets = 2;
  while (Drive(drive_corners(streets, options.street_spacing_m)).length() < needed) ++streets;
  const Drive drive(drive_corners(streets, options.street_spacing_m));
  add_drive(options, *scene, drive, 0, first, layout);
  add_drive(options, *scene, drive, 1, options.frames - first, layout);
  layout.scene = std::move(scene);
  return layout;
}

}  // namespace megablock
