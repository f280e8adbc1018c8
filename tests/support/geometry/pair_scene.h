// Simulates two images of a scene for the solvers of relative orientation. The camera is that of the simulations of
// Nister (2004) and Kalantari (2009), with 352 x 288 pixels and 45 degrees, with points at depths of 1 to 3 or in the
// plane of depth 2; or that of an aerial block.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include "geometry/two_view/relative_orientation.h"

namespace megablock {

inline constexpr double kSceneFocalPx = 424.9;

struct PairSceneOptions {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d base{0.3, 0, 0};  // X_b = R X_a + base; zero: a common centre
  bool plane = false;
  double noise_px = 0;  // per coordinate, both images
  double outliers = 0;  // share of pairs whose point in b is unrelated to that in a
  double focal_px = kSceneFocalPx, half_width_px = 176, half_height_px = 144;
  double depth = 2, depth_spread = 1;  // mean depth, and its largest deviation to either side
  bool in_both = false;                // all points are also within the image b

  // Two nadir images with 3000 x 2000 pixels from one flight line, of an almost plane scene: points at depths of
  // 1 +- 0.025. The length of the base is thus the base-to-height ratio.
  static PairSceneOptions aerial(const Eigen::Vector3d& base, double noise_px) {
    PairSceneOptions o;
    o.base = base;
    o.noise_px = noise_px;
    o.focal_px = 3000;
    o.half_width_px = 1500;
    o.half_height_px = 1000;
    o.depth = 1;
    o.depth_spread = 0.025;
    o.in_both = true;
    return o;
  }
};

struct PairScene {
  std::vector<Eigen::Vector3d> a, b;  // unit rays
  RelativeOrientation truth;          // its base is arbitrary where there is none

  template <typename Random>
  PairScene(const PairSceneOptions& options, std::size_t count, Random& random) {
    std::uniform_real_distribution<double> uniform(-1, 1);
    std::normal_distribution<double> noise(0, options.noise_px > 0 ? options.noise_px / options.focal_px : 1);
    const double half_width = options.half_width_px / options.focal_px,
                 half_height = options.half_height_px / options.focal_px;
    const auto disturbed = [&](Eigen::Vector3d x) {
      if (options.noise_px > 0) x.head<2>() += x.z() * Eigen::Vector2d(noise(random), noise(random));
      return x.normalized();
    };
    while (a.size() < count) {
      const double z = options.plane ? options.depth : options.depth + options.depth_spread * uniform(random);
      const Eigen::Vector3d point(z * half_width * uniform(random), z * half_height * uniform(random), z);
      Eigen::Vector3d other = options.rotation * point + options.base;
      if (other.norm() < 0.1) continue;
      if (options.in_both &&
          !(std::abs(other.x()) < half_width * other.z() && std::abs(other.y()) < half_height * other.z()))
        continue;
      if (0.5 * (uniform(random) + 1) < options.outliers)
        other = options.rotation * Eigen::Vector3d(half_width * uniform(random), half_height * uniform(random), 1);
      a.push_back(disturbed(point));
      b.push_back(disturbed(other));
    }
    truth.rotation = options.rotation;
    if (options.base.norm() > 0) truth.base = options.base.normalized();
  }

  template <std::size_t N>
  std::array<Eigen::Vector3d, N> first(const std::vector<Eigen::Vector3d>& rays) const {
    std::array<Eigen::Vector3d, N> result;
    std::copy_n(rays.begin(), N, result.begin());
    return result;
  }
};

inline double degrees(double radians) { return radians * 180 / std::numbers::pi; }
inline double angle_between(const Eigen::Vector3d& p, const Eigen::Vector3d& q) {
  return std::atan2(p.cross(q).norm(), p.dot(q));
}
inline double rotation_error_deg(const RelativeOrientation& o, const RelativeOrientation& truth) {
  return degrees(rotation_angle(o.rotation, truth.rotation));
}
inline double base_error_deg(const RelativeOrientation& o, const RelativeOrientation& truth) {
  return degrees(angle_between(o.base, truth.base));
}

// The smallest sum of both errors.
template <typename List>
double nearest_error_deg(const List& found, const RelativeOrientation& truth) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const RelativeOrientation& o : found)
    nearest = std::min(nearest, rotation_error_deg(o, truth) + base_error_deg(o, truth));
  return nearest;
}

template <typename Random>
Eigen::Vector3d random_direction(Random& random) {
  std::normal_distribution<double> normal(0, 1);
  const double x = normal(random), y = normal(random), z = normal(random);
  return Eigen::Vector3d(x, y, z).normalized();
}

}  // namespace megablock
