// The vanishing point with most votes among the intersections of any two lines: for comparison with vanishing_points.h
// (Kalantari 2009, M36; C. Rother, "A new approach to vanishing point detection in architectural environments", Image
// and Vision Computing 20(9-10), 2002).
//
// Any two planes propose the direction N1 x N2 (interpretation_plane.h), and every line votes for the directions close
// to its plane, by 1 - angle / tolerance. No adjustment follows, and two lines that meet far away hardly tell where.
// The time grows with the third power of the number of lines.
//
// Solutions: one. Degenerate: lines whose planes are all the same.
#pragma once

#include <optional>
#include <span>

#include "geometry/numbers/angles.h"
#include "geometry/vanishing/interpretation_plane.h"

namespace megablock {

// A unit vector, or its negative. Empty for fewer than two lines and degenerate ones; planes that are not numbers are
// passed over.
std::optional<Eigen::Vector3d> vanishing_point_by_votes(std::span<const InterpretationPlane> planes,
                                                        double tolerance = 5 * kDegree);

}  // namespace megablock
