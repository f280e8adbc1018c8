// Fundamental and essential matrix from seven, eight or more points: b' F a = 0.
//
// Eight and more: the equations are linear in the nine entries; the least squares solution is brought to rank two (F)
// or to the nearest essential matrix (E) afterwards. Pixels are shifted to their mean and scaled to a mean distance of
// sqrt(2) before, without which the entries are not comparable (R. Hartley, "In defence of the eight-point algorithm",
// IEEE PAMI 19(6), 1997); unit rays need none of that. Seven: the two matrices the equations leave are combined so that
// det(F1 + s F2) = 0, a cubic with one or three real roots (Hartley and Zisserman 2004, 11.1.2).
//
// Solutions: seven points one or three, more points one. Degenerate: all points in one plane (any base fits, the
// equations have rank six), points and centres on a common quadric, no base.
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <span>

#include "geometry/numbers/solutions.h"

namespace megablock {

// Pixels. Of Frobenius norm one and rank two. Empty for degenerate ones, two pairs that are one among them, and where
// one is not a number.
Solutions<Eigen::Matrix3d, 3> solve_seven_point(const std::array<Eigen::Vector2d, 7>& a,
                                                const std::array<Eigen::Vector2d, 7>& b);

// Least squares over eight and more pixels; empty for fewer, for degenerate ones and where one is not a number.
std::optional<Eigen::Matrix3d> fit_fundamental(std::span<const Eigen::Vector2d> a, std::span<const Eigen::Vector2d> b);

// The same of unit rays, essential (relative_orientation.h).
std::optional<Eigen::Matrix3d> fit_essential(std::span<const Eigen::Vector3d> a, std::span<const Eigen::Vector3d> b);

// Similarity of the plane that shifts points to their mean and scales them to a mean distance of sqrt(2) from it;
// empty where they coincide.
std::optional<Eigen::Matrix3d> normalising_transformation(std::span<const Eigen::Vector2d> points);

}  // namespace megablock
