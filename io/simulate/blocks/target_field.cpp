// Simulates a target field on which the rig of a vehicle is calibrated: an area between walls, with targets (the
// control points) and tie points on walls and ground. The shapes of the paths are those of Cannelle (2013), 2.4; they
// decide how well the rig is determined.
#include "io/simulate/blocks/target_field.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "geometry/numbers/angles.h"
#include "io/simulate/blocks/vehicle.h"
#include "io/simulate/streets/drive.h"

namespace megablock {

namespace {

constexpr double kHalfLength = 30, kHalfWidth = 20;  // of the area, metres
constexpr double kWallHeight = 24;  // metres; cameras that look up must see walls from the middle of the area
using Path = SimulationOptions::Path;

class TargetField : public Scene {
 public:
  explicit TargetField(bool one_wall) : one_wall_(one_wall) {}

  // A random point on one of the four walls or on the ground. In the sparse scene, on the wall ahead only.
  std::optional<SurfacePoint> sample(const Pose&, Random& random) const override {
    const double u = random.uniform(-1, 1), v = random.uniform();
    // The walls get three quarters of the points, each in proportion to its length, and the ground one quarter.
    const double place = one_wall_ ? 0 : random.uniform(0, 2 * (kHalfLength + kHalfWidth) / 0.75);
    const double x = u * kHalfLength, y = u * kHalfWidth, z = v * kWallHeight;
    if (place < kHalfWidth) return SurfacePoint{{kHalfLength, one_wall_ ? 0.3 * y : y, z}, -Eigen::Vector3d::UnitX()};
    if (place < 2 * kHalfWidth) return SurfacePoint{{-kHalfLength, y, z}, Eigen::Vector3d::UnitX()};
    if (place < 2 * kHalfWidth + kHalfLength) return SurfacePoint{{x, kHalfWidth, z}, -Eigen::Vector3d::UnitY()};
    if (place < 2 * (kHalfWidth + kHalfLength)) return SurfacePoint{{x, -kHalfWidth, z}, Eigen::Vector3d::UnitY()};
    return SurfacePoint{{x, (2 * v - 1) * kHalfWidth, 0}, Eigen::Vector3d::UnitZ()};
  }
  bool visible(const Eigen::Vector3d& eye, const SurfacePoint& point) const override {
    const Eigen::Vector3d sight = point.position - eye;
    return -sight.dot(point.normal) > 0.12 * sight.norm();
  }
  double range_m() const override { return 2 * std::hypot(kHalfLength, kHalfWidth); }
  bool along_passes() const override { return false; }

 private:
  bool one_wall_;
};

std::vector<Eigen::Vector2d> circle(double rx, double ry) {
  std::vector<Eigen::Vector2d> corners;
  for (int k = 0; k <= 48; ++k) {
    const double angle = 2 * std::numbers::pi * k / 48;
    corners.emplace_back(rx * std::cos(angle), ry * std::sin(angle));
  }
  return corners;
}

// Two half circles with opposite turns: an S that lies on its side.
std::vector<Eigen::Vector2d> s_shape(double radius) {
  std::vector<Eigen::Vector2d> corners;
  for (int k = 0; k <= 48; ++k) {
    // First half: a circle about (-r, 0) clockwise over its upper side; second half: one about (r, 0) counter-clockwise
    // over its lower side.
    const double angle = std::numbers::pi * (1 - k / 24.0);
    const double side = k <= 24 ? -1 : 1;
    corners.emplace_back(radius * (side + std::cos(k <= 24 ? angle : angle + std::numbers::pi)),
                         radius * std::sin(angle));
  }
  return corners;
}

std::vector<Eigen::Vector2d> path_corners(Path path) {
  switch (path) {
    // Half a metre of way: the frames of a single standpoint stand close together, not at one point.
    case Path::kSingle:
      return {{0, 0}, {0.5, 0}};
    case Path::kLoop:
      return circle(16, 10);
    case Path::kLine:
      return {{-18, 0}, {18, 0}};
    case Path::kSparse:
      return {{-6, 0}, {6, 0}};
    default:
      return s_shape(9);
  }
}

// Adds a pass with frames at equal distances along a path.
void add_path(const SimulationOptions& options, Path path, std::int64_t pass, std::int64_t frames, Layout& layout) {
  const Drive way(path_corners(path));
  for (std::int64_t i = 0; i < frames; ++i) {
    Random random(options.seed, Random::Purpose::kFrame, static_cast<std::uint64_t>(layout.block.frames.size()));
    const double s = way.length() * (static_cast<double>(i) + 0.5) / static_cast<double>(frames);
    const Eigen::Vector2d ahead = (way.at(s + 0.2) - way.at(s - 0.2)).normalized();
    Pose pose;
    // A vehicle is never exactly on its path: 2 cm, and half a degree of tilt.
    pose.centre << way.at(s) + 0.02 * random.normal3().head<2>(), kRigHeight + 0.02 * random.normal();
    pose.rotation =
        rotation_update(level_rotation(ahead), kDegree * Eigen::Vector3d(0.5, 0.5, 1).cwiseProduct(random.normal3()));
    add_simulated_frame(layout, pose, pass, 1000 * static_cast<double>(pass) + static_cast<double>(i));
  }
}

}  // namespace

Layout make_target_field_layout(const SimulationOptions& options) {
  Layout layout;
  add_vehicle(options, layout);
  if (options.path == Path::kAll) {
    const Path parts[] = {Path::kS, Path::kLoop, Path::kLine};
    std::int64_t left = options.frames;
    for (std::int64_t pass = 0; pass < 3; ++pass) {
      const std::int64_t frames = left / (3 - pass);
      add_path(options, parts[pass], pass, frames, layout);
      left -= frames;
    }
  } else {
    add_path(options, options.path, 0, options.frames, layout);
  }
  layout.scene = std::make_unique<TargetField>(options.path == Path::kSparse);
  return layout;
}

}  // namespace megablock
