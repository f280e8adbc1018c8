// Finds the pose of a camera from three points (the perspective three-point problem, "space resection"). There are up
// to four solutions.
//
// The unknowns are the distances s_i of the points from the projection centre. With the angles between the rays known,
// the triangle gives three cosine laws, quadrics in s:
//
//     s_i^2 + s_j^2 - 2 s_i s_j cos(ray_i, ray_j) = |X_i - X_j|^2      (i, j) = (1,2), (0,2), (0,1)
//
// Two combinations of them have no constant term and are conics in the projective plane of s. A singular conic of their
// pencil, which the real root of a cubic gives, is a pair of lines (M. Persson and K. Nordberg, "Lambda Twist: an
// accurate fast robust perspective three point (P3P) solver", ECCV 2018). The adjugate of its matrix splits the pair
// (J. Richter-Gebert, "Perspectives on projective geometry", 2011, section 11.1). Each line meets the conics in at most
// two points. Newton's iteration on the cosine laws polishes the distances.
//
// Degenerate case: points on one line. On the danger cylinder, which stands at right angles on the plane of the points
// over the circle through them, two solutions coincide (E. H. Thompson, "Space resection: failure cases",
// Photogrammetric Record 5(27), 1966). The errors there grow as the square root of the errors of the rays, and four of
// a thousand exact samples on it are missed; near it the errors grow fast.
#pragma once

#include <Eigen/Core>
#include <array>

#include "geometry/numbers/solutions.h"
#include "geometry/transform/pose.h"

namespace megablock {

// `rays` are unit viewing directions in camera axes; `points` are in the ground frame, in the same order. Returns poses
// ground -> camera with all points in front. Empty for points on one line and where no pose sees the points so.
Solutions<Pose, 4> solve_p3p(const std::array<Eigen::Vector3d, 3>& rays, const std::array<Eigen::Vector3d, 3>& points);

}  // namespace megablock
