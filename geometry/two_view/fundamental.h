// Finds fundamental and essential matrices, b' F a = 0, from seven, eight or more points.
//
// The equations are linear in the nine elements. For eight and more points the least-squares solution is brought to
// rank two (F) or to the nearest essential matrix (E) afterwards. Pixels are first shifted to their mean and scaled to
// a mean distance of sqrt(2) from it; otherwise the elements would differ by orders of magnitude and the least squares
// would be dominated by a few (R. Hartley, "In defence of the eight-point algorithm", IEEE PAMI 19(6), 1997). Unit rays
// need no such scaling.
//
// Seven equations leave a family of two matrices. det(F1 + s F2) = 0 is a cubic in s with one or three real roots (R.
// Hartley and A. Zisserman, "Multiple view geometry", 2004, section 11.1.2).
//
// Number of solutions: one or three for seven points, one for more. Degenerate cases: all points in one plane (any base
// fits; the equations have rank six), points and centres on a common quadric, no base.
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <span>

#include "geometry/numbers/solutions.h"

namespace megablock {

// Takes pixels. Returns matrices of rank two and Frobenius norm one. Empty for degenerate points (which include two
// identical pairs) and for input that is not finite.
Solutions<Eigen::Matrix3d, 3> solve_seven_point(const std::array<Eigen::Vector2d, 7>& a,
                                                const std::array<Eigen::Vector2d, 7>& b);

// Least squares over eight or more pairs of pixels. Empty for fewer pairs, for degenerate points and for input that is
// not finite.
std::optional<Eigen::Matrix3d> fit_fundamental(std::span<const Eigen::Vector2d> a, std::span<const Eigen::Vector2d> b);

// The same for unit rays; returns an essential matrix (relative_orientation.h).
std::optional<Eigen::Matrix3d> fit_essential(std::span<const Eigen::Vector3d> a, std::span<const Eigen::Vector3d> b);

// Returns the transformation that shifts points to their mean and scales them to a mean distance of sqrt(2) from it.
// Empty for points that coincide.
std::optional<Eigen::Matrix3d> normalising_transformation(std::span<const Eigen::Vector2d> points);

}  // namespace megablock
