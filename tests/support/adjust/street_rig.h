// Gives a panoramic head for tests: ten cameras of 1920 x 1080, f = 1400 px, eight around the compass and two up.
#pragma once

#include <numbers>
#include <optional>
#include <random>
#include <vector>

#include "geometry/resection/rig_ray.h"

namespace megablock {

struct StreetRig {
  std::vector<Pose> mounts;
  Intrinsics intrinsics{};

  StreetRig() {
    intrinsics[kFocal] = 1400, intrinsics[kPrincipalX] = 961, intrinsics[kPrincipalY] = 542;
    for (int i = 0; i < 10; ++i) {
      // Rig axes: x right, y down, z forward.
      const double yaw = i < 8 ? i * std::numbers::pi / 4 : (i - 8) * std::numbers::pi;
      const double pitch = i < 8 ? 0 : 0.7;
      const Eigen::Quaterniond turn(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitY()) *
                                    Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitX()));
      mounts.push_back({turn.conjugate(), turn * Eigen::Vector3d(0, 0, 0.25)});
    }
  }

  // Pixel of a point in rig coordinates, by the first camera that sees it.
  struct CameraPixel {
    std::size_t camera;
    Eigen::Vector2d pixel;
  };
  std::optional<CameraPixel> see(const Eigen::Vector3d& in_rig) const {
    for (std::size_t c = 0; c < mounts.size(); ++c) {
      const Eigen::Vector3d p = to_inside(mounts[c], in_rig);
      if (!(p.z() > 0.5)) continue;
      const Eigen::Vector2d pixel = project(intrinsics, p);
      if (pixel.x() > 0 && pixel.x() < 1920 && pixel.y() > 0 && pixel.y() < 1080) return CameraPixel{c, pixel};
    }
    return std::nullopt;
  }
  // The ray of a pixel_in_camera with noise.
  RigRay ray(const CameraPixel& pixel_in_camera, const Eigen::Vector2d& noise) const {
    return *rig_ray(mounts[pixel_in_camera.camera], intrinsics, pixel_in_camera.pixel + noise);
  }
};

inline const StreetRig& street_rig() {
  static const StreetRig rig;
  return rig;
}

// Level rig at a place, driving along `heading` (radians from east, anticlockwise), tilted a little.
inline Pose level_rig(const Eigen::Vector3d& centre, double heading, const Eigen::Vector3d& tilt = {0, 0, 0}) {
  Eigen::Matrix3d r;
  r.row(0) << std::sin(heading), -std::cos(heading), 0;
  r.row(1) << 0, 0, -1;
  r.row(2) << std::cos(heading), std::sin(heading), 0;
  return {rotation_update(Eigen::Quaterniond(r).normalized(), tilt), centre};
}

// Seeded normal numbers.
class Noise {
 public:
  explicit Noise(std::uint64_t seed) : random_(seed) {}
  double operator()() { return normal_(random_); }
  double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }
  Eigen::Vector2d pair() { return {(*this)(), (*this)()}; }
  Eigen::Vector3d triple() { return {(*this)(), (*this)(), (*this)()}; }
  std::mt19937_64& engine() { return random_; }

 private:
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_{0, 1};
};

}  // namespace megablock
