// Pose between two positions of one triangle, in closed form.
#pragma once

#include <array>
#include <optional>

#include "geometry/transform/pose.h"

namespace megablock {

// Twice the triangle's area, against the sum of its squared sides: below it the corners count as lying on one line.
inline constexpr double kMinTriangleArea = 1e-9;

// Orthonormal axes of a triangle.
inline Eigen::Matrix3d triangle_axes(const std::array<Eigen::Vector3d, 3>& p) {
  Eigen::Matrix3d axes;
  axes.col(0) = (p[1] - p[0]).normalized();
  axes.col(2) = (p[1] - p[0]).cross(p[2] - p[0]).normalized();
  axes.col(1) = axes.col(2).cross(axes.col(0));
  return axes;
}

// Pose outside -> inside that puts the corners `outside` on those `inside`; empty for corners on one line.
inline std::optional<Pose> triangle_pose(const std::array<Eigen::Vector3d, 3>& inside,
                                         const std::array<Eigen::Vector3d, 3>& outside) {
  const Eigen::Matrix3d rotation = triangle_axes(inside) * triangle_axes(outside).transpose();
  if (!rotation.allFinite()) return std::nullopt;
  const Eigen::Quaterniond q = Eigen::Quaterniond(rotation).normalized();
  return Pose{q, outside[0] - q.conjugate() * inside[0]};
}

}  // namespace megablock
