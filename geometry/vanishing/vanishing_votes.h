// Finds the vanishing point with most votes among the intersections of all pairs of lines (C. Rother, "A new approach
// to vanishing point detection in architectural environments", Image and Vision Computing 20(9-10), 2002; Kalantari
// 2009, chapter 6). The function exists for comparison with vanishing_points.h.
//
// Each pair of planes proposes the direction N1 x N2 (interpretation_plane.h). Every line votes for the directions
// close to its plane, with 1 - angle / tolerance. There is no adjustment, and two lines that meet far away hardly
// determine where. The time grows with the third power of the number of lines.
//
// There is one solution. Degenerate case: all planes are the same.
#pragma once

#include <optional>
#include <span>

#include "geometry/numbers/angles.h"
#include "geometry/vanishing/interpretation_plane.h"

namespace megablock {

// Returns a unit vector of undefined sign. `tolerance` is in radians. Empty for fewer than two lines and for equal
// planes; planes that are not finite are ignored.
std::optional<Eigen::Vector3d> vanishing_point_by_votes(std::span<const InterpretationPlane> planes,
                                                        double tolerance = 5 * kDegree);

}  // namespace megablock
