// Finds the similarity y = s R x + t from three points in closed form (Kalantari 2009, chapter 9). There is one
// solution.
//
// Let d be the difference of two points and e the same difference in the other system. Cayley's form of the rotation,
// R = (I - [v]x)^-1 (I + [v]x), turns e = s R d into
//
//     e - s d = v x (e + s d),
//
// The scale s follows from the lengths of the three sides, and the equation is then linear in v. All nine equations of
// the three sides enter the least squares. The thesis takes four of them; its errors are two to five times as large and
// depend on the order of the points.
//
// v grows without bound towards a rotation of 180 degrees. The points may therefore be turned first by a half turn
// about one of the axes. Of these turns (or none) the one whose normal equations have the largest determinant is taken.
//
// Degenerate case: points on one line.
#pragma once

#include <array>
#include <optional>

#include "geometry/similarity/similarity.h"

namespace megablock {

// Returns the similarity from -> to. Empty for points on one line (or coincident) in either system, and for input that
// is not finite.
std::optional<Similarity> solve_similarity(const std::array<Eigen::Vector3d, 3>& from,
                                           const std::array<Eigen::Vector3d, 3>& to);

}  // namespace megablock
