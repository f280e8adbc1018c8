// Simulates the verticals that the images of a block see.
#pragma once

#include <random>

#include "geometry/camera/camera.h"
#include "geometry/numbers/angles.h"
#include "io/simulate/blocks/simulate.h"

namespace megablock {

struct SeenVerticalOptions {
  double sigma_deg = 0.05;  // stated, across the direction
  double noise_deg = 0.05;  // gaussian, the same
  double wrong_share = 0;   // of images whose vertical is off by wrong_deg in any direction
  double wrong_deg = 20;
  double by_radial = 0;  // radians by which down is off per unit of k1, the image pitching; 0: owes the camera nothing
  int every = 1;         // images with a vertical
};

inline void add_seen_verticals(SimulatedBlock& simulated, const SeenVerticalOptions& options) {
  Block& block = simulated.block;
  std::mt19937_64 random(1234);
  std::normal_distribution<double> gauss(0, options.noise_deg * kDegree);
  std::uniform_real_distribution<double> uniform(0, 1);
  for (std::size_t row = 0; row < block.images.size(); row += static_cast<std::size_t>(options.every)) {
    SeenVertical seen;
    seen.image = ImageIndex(static_cast<std::int64_t>(row));
    const Image& image = block.images[seen.image];
    const Frame& frame = block.frames[image.frame];
    const Eigen::Vector3d down = simulated.truth.mounts[frame.rig][static_cast<std::size_t>(image.mount)].rotation *
                                 (simulated.truth.frames[image.frame].rotation * -Eigen::Vector3d::UnitZ());
    const Eigen::Matrix<double, 3, 2> plane = tangent_plane(down);
    Eigen::Vector2d error(gauss(random), gauss(random));
    const double azimuth = 2 * std::acos(-1.0) * uniform(random);
    if (uniform(random) < options.wrong_share)
      error += std::tan(options.wrong_deg * kDegree) * Eigen::Vector2d(std::cos(azimuth), std::sin(azimuth));
    seen.down = down + plane * error;
    if (options.by_radial != 0) {
      const CameraIndex camera = block.camera_of(seen.image);
      const Intrinsics& given = block.cameras[camera].intrinsics;
      seen.camera = Eigen::Map<const Eigen::VectorXd>(given.data(), given.size());
      seen.by_camera = Eigen::Matrix3Xd::Zero(3, given.size());
      seen.by_camera.col(kRadial1) = options.by_radial * Eigen::Vector3d::UnitX().cross(down);
      seen.down += seen.by_camera.col(kRadial1) * (given[kRadial1] - simulated.truth.cameras[camera][kRadial1]);
    }
    seen.down.normalize();
    const Eigen::Matrix<double, 3, 2> across = tangent_plane(seen.down);
    seen.covariance = std::pow(options.sigma_deg * kDegree, 2) * across * across.transpose();
    block.verticals.push_back(seen);
  }
}

}  // namespace megablock
