// Adds vertical and horizontal lines to a simulated block, measured with the true cameras.
#pragma once

#include <cmath>
#include <random>

#include "adjust/terms/vertical_terms.h"
#include "io/simulate/blocks/simulate.h"

namespace megablock {

// One line of 3 m at every `stride`-th track, vertical and horizontal in turn; ends with gaussian noise per axis.
inline void add_known_lines(SimulatedBlock& simulated, std::int64_t stride, double noise_px) {
  const BlockState& truth = simulated.truth;
  const Block& block = simulated.block;
  const GroundVertical ground(block.ground);
  std::mt19937_64 random(77);
  std::normal_distribution<double> gauss(0, 1);
  for (std::int64_t t = 0; t < simulated.tracks.track_count(); t += stride) {
    const bool vertical = (t / stride) % 2 == 0;
    const double azimuth = 0.7 * static_cast<double>(t);
    const Eigen::Vector3d up = -ground.down(simulated.points[t]),
                          level = up.cross(Eigen::Vector3d(std::cos(azimuth), std::sin(azimuth), 0)).normalized();
    const Eigen::Vector3d half = 1.5 * (vertical ? up : level);
    KnownLine line{"line " + std::to_string(t),
                   vertical ? KnownLine::Direction::kVertical : KnownLine::Direction::kHorizontal,
                   {}};
    for (std::int64_t o = simulated.tracks.begin[t]; o < simulated.tracks.begin[t + 1]; ++o) {
      const ImageIndex image = simulated.tracks.image[o];
      const FrameIndex frame = block.images[image].frame;
      const Rig& rig = block.rig_of(frame);
      const Pose& mount = truth.mounts[block.frames[frame].rig][static_cast<std::size_t>(block.images[image].mount)];
      const Camera& camera = block.cameras[rig.mounts[static_cast<std::size_t>(block.images[image].mount)].camera];
      const auto pixel = [&](const Eigen::Vector3d& point) {
        return Eigen::Vector2d(
            project(truth.cameras[block.camera_of(image)], to_camera(truth.frames[frame], mount, point)) +
            noise_px * Eigen::Vector2d(gauss(random), gauss(random)));
      };
      // Other points of the line in every image.
      const double along = 0.2 * gauss(random);
      const Eigen::Vector2d first = pixel(simulated.points[t] - (1 + along) * half),
                            second = pixel(simulated.points[t] + (1 - along) * half);
      const auto inside = [&](const Eigen::Vector2d& p) {
        return p.x() > 0 && p.y() > 0 && p.x() < camera.width && p.y() < camera.height;
      };
      if (inside(first) && inside(second) && (second - first).norm() > 20)
        line.measurements.push_back({image, first, second, noise_px > 0 ? noise_px : 0.5});
    }
    if (line.measurements.size() >= 2) simulated.block.lines.push_back(line);
  }
}

}  // namespace megablock
