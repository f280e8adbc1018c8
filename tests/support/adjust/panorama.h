// Repeats the simulations of Cannelle (2013), 2.3.3: a camera turns about a point, and all points of a geodesic sphere
// are measured in all images that see them.
#pragma once

#include <cmath>

#include "adjust/calibration/panoramic.h"
#include "geometry/camera/camera.h"
#include "io/simulate/blocks/panorama.h"
#include "io/simulate/scene/published_cameras.h"
#include "io/simulate/scene/random.h"

namespace megablock {

struct PanoramaSimulation {
  std::int64_t images = 36;
  int subdivisions = 4;                                  // of the sphere
  double radius_m = 10, depth_spread = 0;                // distances are radius * (1 +- spread)
  double noise_px = 0.5;                                 // per axis
  Eigen::Vector3d off_centre = Eigen::Vector3d::Zero();  // projection centre from the axis, camera axes, metres
  double wrong_share = 0;                                // of measurements anywhere in the image
  std::uint64_t seed = 1;
};

struct SimulatedPanorama {
  PanoramicTracks tracks;
  std::vector<Eigen::Quaterniond> rotations;
};

inline SimulatedPanorama simulate_panorama(const Intrinsics& camera, int width, int height,
                                           const PanoramaSimulation& options) {
  SimulatedPanorama result;
  const double across = 2 * std::atan(0.5 * width / camera[kFocal]), up = 2 * std::atan(0.5 * height / camera[kFocal]);
  result.rotations = panorama_rotations(across, up, options.images);
  for (std::size_t i = 0; i < result.rotations.size(); ++i) result.tracks.images.push_back("i" + std::to_string(i));
  const double corner = std::atan(0.55 * std::hypot(width, height) / camera[kFocal]);
  std::uint64_t number = 0;
  for (const Eigen::Vector3d& direction : geodesic_sphere(options.subdivisions)) {
    Random random(options.seed, Random::Purpose::kTracks, number++);
    const double distance = options.radius_m * (1 + options.depth_spread * random.uniform(-1, 1));
    for (std::size_t i = 0; i < result.rotations.size(); ++i) {
      const Eigen::Vector3d inside = distance * (result.rotations[i] * direction) - options.off_centre;
      if (inside.z() < std::cos(corner) * inside.norm()) continue;
      const Eigen::Vector2d seen = project(camera, inside);
      const Eigen::Vector2d noise(random.normal(), random.normal());
      // Drawn whether they are needed or not, so that noise of any size is the same draw.
      const Eigen::Vector2d anywhere(random.uniform(0, width), random.uniform(0, height));
      const bool wrong = random.uniform() < options.wrong_share;
      Eigen::Vector2d pixel = seen + options.noise_px * noise;
      if (!(pixel.x() > 0 && pixel.x() < width && pixel.y() > 0 && pixel.y() < height)) continue;
      if (wrong) pixel = anywhere;
      result.tracks.image.push_back(static_cast<int>(i));
      result.tracks.pixel.push_back(pixel);
    }
    const auto rows = static_cast<std::int64_t>(result.tracks.image.size());
    if (rows - result.tracks.begin.back() < 2) {  // nothing to compare
      result.tracks.image.resize(static_cast<std::size_t>(result.tracks.begin.back()));
      result.tracks.pixel.resize(static_cast<std::size_t>(result.tracks.begin.back()));
    } else {
      result.tracks.begin.push_back(rows);
    }
  }
  return result;
}

// What the published simulations start from: focal length at 80 %, centres in the middle, no distortion.
inline Intrinsics published_start(const Intrinsics& truth, int width, int height) {
  return start_intrinsics(truth.model(), 0.8 * truth[kFocal], width, height);
}

struct PanoramicError {
  double focal_px, principal_px, symmetry_px;
  double edge_px;  // of the correction at the corner farthest from the true centre of symmetry
};
inline PanoramicError error_of(const Intrinsics& k, const Intrinsics& truth, int width, int height) {
  const auto point = [](const Intrinsics& c, int p) { return Eigen::Vector2d(c[p], c[p + 1]); };
  const Eigen::Vector2d symmetry = point(truth, kSymmetryX);
  const Eigen::Vector2d corner(symmetry.x() > 0.5 * width ? 0 : width, symmetry.y() > 0.5 * height ? 0 : height);
  return {std::abs(k[kFocal] - truth[kFocal]), (point(k, kPrincipalX) - point(truth, kPrincipalX)).norm(),
          (point(k, kSymmetryX) - symmetry).norm(),
          (correction_at(k, corner).value - correction_at(truth, corner).value).norm()};
}

}  // namespace megablock
