// Finds the rotation between two images with a common centre (or of very distant points) from two rays in each, b = R
// a. There is one solution.
//
// Each pair of rays spans an orthonormal system: their bisector, their normal, and the third axis. To turn one system
// onto the other shares the misfit between both rays, as least squares does (rotation_fit.h takes more than two rays).
// Axes from two directions: H. D. Black, "A passive system for determining the attitude of a satellite", AIAA Journal
// 2(7), 1964; with equal weights: F. L. Markley, "Attitude determination using two vector measurements", Flight
// Mechanics Symposium, NASA, 1999.
//
// Degenerate case: two rays on one line. The closer they are to it, the less certain is the rotation about them.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>

namespace megablock {

// Takes unit rays and returns the rotation a -> b. Empty where two rays of an image are on one line within a
// microradian, and for input that is not finite.
inline std::optional<Eigen::Quaterniond> solve_rotation_pair(const Eigen::Vector3d& a1, const Eigen::Vector3d& a2,
                                                             const Eigen::Vector3d& b1, const Eigen::Vector3d& b2) {
  const auto axes = [](const Eigen::Vector3d& first, const Eigen::Vector3d& second) {
    // The sum and the difference of unit vectors are perpendicular. The longer of the two is used, as it is more
    // accurate.
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
