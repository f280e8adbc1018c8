// Rotation between two images from one centre (or of points very far away): two rays in each, b = R a. One solution.
//
// Each pair spans the axes: bisector, normal, and what completes them. That shares the misfit of the angle between the
// two rays, as least squares over both does (rotation_fit.h takes more than two). H. D. Black, "A passive system for
// determining the attitude of a satellite", AIAA Journal 2(7), 1964, has axes from two directions; both alike: F. L.
// Markley, "Attitude determination using two vector measurements", Flight Mechanics Symposium, NASA, 1999.
//
// Degenerate: two rays along one line; the nearer they are, the less certain is the turn about them.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>

namespace megablock {

// Unit rays; empty where the two of an image are on one line within a microradian, or something is not a number.
inline std::optional<Eigen::Quaterniond> solve_rotation_pair(const Eigen::Vector3d& a1, const Eigen::Vector3d& a2,
                                                             const Eigen::Vector3d& b1, const Eigen::Vector3d& b2) {
  const auto axes = [](const Eigen::Vector3d& first, const Eigen::Vector3d& second) {
    // Sum and difference of unit vectors are perpendicular; the shorter of both is the less accurate.
    const Eigen::Vector3d sum = first + second, difference = second - first;
    Eigen::Matrix3d m;
    m.col(1) = first.cross(second).normalized();
    const bool sum_longer = sum.squaredNorm() > difference.squaredNorm();
    m.col(0) = sum_longer ? sum.normalized() : m.col(1).cross(-difference).normalized();
    m.col(2) = m.col(0).cross(m.col(1));
    return m;
  };
  constexpr double kOneLine = 1e-12;  // squared sine
  if (!(a1.cross(a2).squaredNorm() > kOneLine && b1.cross(b2).squaredNorm() > kOneLine)) return std::nullopt;
  const Eigen::Quaterniond q(Eigen::Matrix3d(axes(b1, b2) * axes(a1, a2).transpose()));
  if (!q.coeffs().allFinite()) return std::nullopt;
  return q.normalized();
}

}  // namespace megablock
