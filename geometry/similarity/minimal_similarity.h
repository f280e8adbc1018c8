// Similarity y = s R x + t from three points in closed form (Kalantari 2009, M50): one solution.
//
// With differences d of two points, e the same in the other system, and Cayley's rotation R = (I - [v]x)^-1 (I + [v]x),
//
//     e - s d = v x (e + s d),
//
// which is linear in v once the scale s is known from the lengths of the three sides. All nine equations of the three
// sides are used in least squares; the thesis takes four of them, its error is two to five times as large and depends
// on the order of the points. v grows beyond bounds for a rotation of 180 deg; so the points may first be turned half
// around an axis, and that turn (or none) is taken whose equations have the largest determinant.
//
// Degenerate: points on one line.
#pragma once

#include <array>
#include <optional>

#include "geometry/similarity/similarity.h"

namespace megablock {

// Empty for points on one line (or together) in either system, and where something is not a number.
std::optional<Similarity> solve_similarity(const std::array<Eigen::Vector3d, 3>& from,
                                           const std::array<Eigen::Vector3d, 3>& to);

}  // namespace megablock
