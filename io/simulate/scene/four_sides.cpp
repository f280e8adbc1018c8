#include "io/simulate/scene/four_sides.h"

#include <array>
#include <cmath>
#include <numbers>

#include "geometry/numbers/angles.h"

namespace megablock {

namespace {

// A camera that looks at this azimuth (from east, counter-clockwise) and is raised by `up`, radians.
Eigen::Quaterniond ring_rotation(double azimuth, double up) {
  const Eigen::Vector3d right(std::sin(azimuth), -std::cos(azimuth), 0);
  const Eigen::Vector3d ahead(std::cos(azimuth) * std::cos(up), std::sin(azimuth) * std::cos(up), std::sin(up));
  Eigen::Matrix3d r;
  r << right.transpose(), ahead.cross(right).transpose(), ahead.transpose();
  return Eigen::Quaterniond(r).normalized();
}

// Frames on a ring that look through its centre, and beside it by the `turns` one after the other, degrees.
Layout make_ring(const SimulationOptions& options, double radius_m, double up_deg, const std::array<double, 3>& turns) {
  Layout layout;
  add_single_camera_rig(options, layout);
  const double step = 2 * std::numbers::pi / static_cast<double>(options.frames);
  for (std::int64_t i = 0; i < options.frames; ++i) {
    Random random(options.seed, Random::Purpose::kFrame, static_cast<std::uint64_t>(i));
    // One after the other, because C++ leaves open in which order it evaluates the arguments of a call.
    const double angle = step * (static_cast<double>(i) + random.uniform(-0.2, 0.2));
    const double radius = radius_m * random.uniform(0.9, 1.1);
    const double height = 1.6 + random.uniform(-0.2, 0.2);
    const double turn = turns[static_cast<std::size_t>(i % 3)] + random.uniform(-4, 4);
    const double up = up_deg + random.uniform(-2, 2);
    const Eigen::Vector3d centre(radius * std::cos(angle), radius * std::sin(angle), height);
    add_simulated_frame(layout, {ring_rotation(angle + std::numbers::pi + kDegree * turn, kDegree * up), centre}, 0,
                        4 * static_cast<double>(i));
  }
  return layout;
}

}  // namespace

Layout make_courtyard_layout(const SimulationOptions& options) {
  // Two images of three look along the facades.
  return make_ring(options, 7, 5, {0, 30, -30});
}

Layout make_tower_layout(const SimulationOptions& options) { return make_ring(options, 23, 7, {0, 5, -5}); }

}  // namespace megablock
