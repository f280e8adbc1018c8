// Finds the pose that moves one triangle onto a congruent one, in closed form. Resection solvers end here: they know
// the three points in camera axes and in the ground frame.
#pragma once

#include <array>
#include <optional>

#include "geometry/transform/pose.h"

namespace megablock {

// Limit for |(b - a) x (c - a)| (twice the area) over the sum of the squared sides. Corners below it count as lying on
// one line.
inline constexpr double kMinTriangleArea = 1e-9;

// Orthonormal axes of a triangle as columns: along the first side, in the plane across it, along the normal.
inline Eigen::Matrix3d triangle_axes(const std::array<Eigen::Vector3d, 3>& p) {
  Eigen::Matrix3d axes;
  axes.col(0) = (p[1] - p[0]).normalized();
  axes.col(2) = (p[1] - p[0]).cross(p[2] - p[0]).normalized();
  axes.col(1) = axes.col(2).cross(axes.col(0));
  return axes;
}

// Returns the pose outside -> inside that moves the corners `outside` to the corners `inside`. The first corners
// coincide exactly, which is enough because the triangles are congruent. Empty for corners on one line.
inline std::optional<Pose> triangle_pose(const std::array<Eigen::Vector3d, 3>& inside,
                                         const std::array<Eigen::Vector3d, 3>& outside) {
  const Eigen::Matrix3d rotation = triangle_axes(inside) * triangle_axes(outside).transpose();
  if (!rotation.allFinite()) return std::nullopt;
  const Eigen::Quaterniond q = Eigen::Quaterniond(rotation).normalized();
  return Pose{q, outside[0] - q.conjugate() * inside[0]};
}

}  // namespace megablock
