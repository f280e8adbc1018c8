// Simulates an aerial block: flight lines to the east and west over smooth terrain, with nadir images whose long side
// is across the line.
//
// With the height H above mean terrain, the focal length f and an image of w x h pixels, the footprint is w H/f across
// and h H/f along the line. Successive images are (1 - forward_overlap) h H/f apart, lines (1 - side_overlap) w H/f.
// The axes of the block have their origin in its middle; z = 0 is the mean terrain.
#include "io/simulate/blocks/aerial.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "geometry/numbers/angles.h"
#include "io/simulate/scene/terrain.h"
#include "io/simulate/scene/wander.h"

namespace megablock {

namespace {

class AerialScene : public Scene {
 public:
  AerialScene(const SimulationOptions& options, const Intrinsics& intrinsics)
      : options_(options), intrinsics_(intrinsics), terrain_(options.seed, options.terrain_relief_m, options.height_m) {
    // Half of the diagonal of the footprint on the deepest terrain, with a margin for tilts, distortion and deviations
    // from the nominal place.
    const double half_diagonal = 0.5 * std::hypot(options.image_width, options.image_height) / options.focal_px;
    const double deepest = options.height_m + options.terrain_relief_m / 2;
    range_m_ = 1.15 * deepest * half_diagonal + 0.1 * options.height_m;
  }

  // Returns the terrain point at a random pixel of the frame's image. Its height is found by fixed-point iteration.
  std::optional<SurfacePoint> sample(const Pose& frame, Random& random) const override {
    // One after the other, because C++ leaves open in which order it evaluates the arguments of a call.
    const double row = random.uniform(0, options_.image_height), column = random.uniform(0, options_.image_width);
    const Eigen::Vector2d pixel(column, row);
    const auto ray = viewing_ray(intrinsics_, pixel);
    if (!ray) return std::nullopt;
    const Eigen::Vector3d direction = frame.rotation.conjugate() * *ray;
    // A ray almost along the horizon may miss the terrain.
    if (direction.z() > -0.1) return std::nullopt;
    Eigen::Vector3d point(frame.centre.x(), frame.centre.y(), 0);
    // The error shrinks in each iteration by the slope of the terrain times the tangent of the nadir angle.
    for (int i = 0; i < 30; ++i) {
      const double z = terrain_.height(point.x(), point.y());
      point = frame.centre + direction * ((z - frame.centre.z()) / direction.z());
    }
    point.z() = terrain_.height(point.x(), point.y());
    return SurfacePoint{point, Eigen::Vector3d::UnitZ()};
  }
  bool visible(const Eigen::Vector3d&, const SurfacePoint&) const override { return true; }
  double range_m() const override { return range_m_; }
  bool along_passes() const override { return false; }

 private:
  SimulationOptions options_;
  Intrinsics intrinsics_;
  Terrain terrain_;
  double range_m_;
};

// The rotation of a nadir camera whose image x axis (right) has the direction `right` (from east, counter-clockwise).
// The y axis of the image (down) then points backwards.
Eigen::Quaterniond nadir_rotation(double right) {
  Eigen::Matrix3d r;
  r.row(0) << std::cos(right), std::sin(right), 0;
  r.row(1) << std::sin(right), -std::cos(right), 0;
  r.row(2) << 0, 0, -1;
  return Eigen::Quaterniond(r).normalized();
}

// A flight line with a rolling shutter: the deviations from it are smooth, so that the path has a velocity.
class SmoothLine {
 public:
  // `deviations`: their rms on the axes, metres.
  SmoothLine(const SimulationOptions& options, std::int64_t line, const Eigen::Vector3d& deviations)
      : SmoothLine(Random(options.seed, Random::Purpose::kTrajectory, static_cast<std::uint64_t>(line)), deviations) {}
  Eigen::Vector3d deviation(double t) const { return deviations_.cwiseProduct(wander_.at(t)); }
  Motion motion(double t, const Eigen::Vector3d& velocity) const {
    return {velocity + deviations_.cwiseProduct(wander_.rate(t)), Eigen::Vector3d::Zero()};
  }

 private:
  SmoothLine(Random random, const Eigen::Vector3d& deviations) : wander_(random), deviations_(deviations) {}
  Wander wander_;
  Eigen::Vector3d deviations_;
};

}  // namespace

Layout make_aerial_layout(const SimulationOptions& options) {
  Layout layout;
  const CameraIndex camera = add_single_camera_rig(options, layout);

  const double base = (1 - options.forward_overlap) * options.height_m * options.image_height / options.focal_px;
  const double spacing = (1 - options.side_overlap) * options.height_m * options.image_width / options.focal_px;
  const double n = static_cast<double>(options.frames);
  // The block is as square on the ground as possible.
  // n / L images per line make the lines (n / L) base long. This equals the width L spacing for L^2 = n base / spacing.
  const auto lines = std::max<std::int64_t>(1, std::llround(std::sqrt(n * base / spacing)));
  const std::int64_t per_line = (options.frames + lines - 1) / lines;
  for (std::int64_t f = 0; f < options.frames; ++f) {
    const std::int64_t line = f / per_line, place = f % per_line;
    const bool westward = line % 2 == 1;
    const double along = static_cast<double>(westward ? per_line - 1 - place : place);
    Random random(options.seed, Random::Purpose::kFrame, static_cast<std::uint64_t>(f));
    const double heading = westward ? std::numbers::pi : 0;
    Pose pose;
    pose.centre = {(along - 0.5 * static_cast<double>(per_line - 1)) * base,
                   (static_cast<double>(line) - 0.5 * static_cast<double>(lines - 1)) * spacing, options.height_m};
    const Eigen::Vector3d deviations(0.03 * base, 0.02 * spacing, 0.01 * options.height_m);
    // Normal deviations are cut off, so that a rare large one cannot open a gap between the lines.
    const Eigen::Vector3d scatter = deviations.cwiseProduct(random.normal3().cwiseMin(2).cwiseMax(-2));
    double time_s = 2.0 * static_cast<double>(f);
    std::optional<Motion> motion;
    if (options.readout_ms == 0) {
      pose.centre += scatter;
    } else {
      constexpr double kTurnS = 20;  // from one line to the next
      const double leg_s = base / options.speed_mps, in_line_s = static_cast<double>(place) * leg_s;
      time_s = static_cast<double>(line) * (static_cast<double>(per_line) * leg_s + kTurnS) + in_line_s;
      const SmoothLine path(options, line, deviations);
      pose.centre += path.deviation(in_line_s);
      motion = path.motion(in_line_s, {(westward ? -1 : 1) * options.speed_mps, 0, 0});
    }
    const Eigen::Vector3d tilt = random.normal3().cwiseMin(2.5).cwiseMax(-2.5);
    pose.rotation = nadir_rotation(heading - std::numbers::pi / 2);
    // Turns about the axes of the ground: two tilts, then the heading.
    pose.rotation = rotation_update(pose.rotation, kDegree * Eigen::Vector3d(1.0, 1.0, 1.5).cwiseProduct(tilt));
    add_simulated_frame(layout, pose, line, time_s, motion);
  }
  layout.scene = std::make_unique<AerialScene>(options, layout.truth.cameras[camera]);
  return layout;
}

}  // namespace megablock
