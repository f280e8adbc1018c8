// Holds the cameras and observations of the determinant method (coplanarity_adjustment.h).
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "geometry/two_view/coplanarity.h"

namespace megablock {

// Cameras of one focal length (px) without distortion. Image coordinates are relative to the principal point.
// Observations of point j are rows [begin[j], begin[j + 1]); the cameras of a point are distinct.
struct CoplanarityNetwork {
  double focal_px = 0;
  std::vector<Eigen::Vector3d> centres;  // [cameras] ground frame, m
  std::vector<XyzAngles> angles;         // [cameras]
  std::vector<std::int64_t> begin{0};    // [points + 1]
  std::vector<std::int32_t> camera;      // [observations]
  std::vector<Eigen::Vector2d> image;    // [observations] px
  // 1 = held. Empty: all free.
  std::vector<std::uint8_t> angles_held;  // [3 x cameras]
  std::vector<std::uint8_t> images_held;  // [2 x observations]

  std::int64_t point_count() const { return static_cast<std::int64_t>(begin.size()) - 1; }
  void check() const;  // throws InputError
};

}  // namespace megablock
