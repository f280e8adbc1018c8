// Finds the pose of a rig from three points, each seen by any of its cameras (the generalised three-point problem).
// There are up to eight solutions.
//
// In rig axes a ray starts at o_i and has the unit direction d_i; its point lies at o_i + s_i d_i with the unknown
// distance s_i. The rig is rigid, so distances between the points are those on the ground:
//
//     |o_i + s_i d_i - o_j - s_j d_j|^2 = |X_i - X_j|^2      (i, j) = (1,2), (1,3), (2,3)
//
// These are three quadrics in the distances. The first two are quadratic equations in s_2 and in s_3 with leading
// coefficient one and coefficients in s_1,
//
//     s_2^2 + b_2 s_2 + c_2 = 0,    s_3^2 + b_3 s_3 + c_3 = 0.
//
// With them the third becomes bilinear, e s_2 s_3 + F s_2 + G s_3 + H = 0. Elimination of s_2, then of s_3, leaves
// U s_3 + V = 0 and an octic in s_1:
//
//     V^2 - b_3 U V + c_3 U^2 = 0.
//
// D. Nister and H. Stewenius, "A minimal solution to the generalised 3-point pose problem", J. Math. Imaging Vision 27,
// 2007, reach the same degree by another way, two circles on a ruled surface. Newton's iteration on the three quadrics
// polishes the distances; the pose follows from the two congruent triangles.
//
// Degenerate cases: points on one line; three parallel rays, along which the rig can slide. Two solutions coincide
// where the triangle can move to first order with each corner along its ray; with one common centre this is the danger
// cylinder (p3p.h). The errors there grow as the square root of the errors of the rays.
#pragma once

#include <Eigen/Core>
#include <array>

#include "geometry/numbers/solutions.h"
#include "geometry/transform/pose.h"

namespace megablock {

// `origins` (metres) and unit `directions` are in rig axes; `points` are in the ground frame (metres), in the same
// order. Returns poses ground -> rig with all points in front of their cameras. Rays from one common centre are passed
// on to solve_p3p. Empty for points on one line, for rays that are all parallel or opposite within 1e-9, and where
// there is no solution.
Solutions<Pose, 8> solve_gp3p(const std::array<Eigen::Vector3d, 3>& origins,
                              const std::array<Eigen::Vector3d, 3>& directions,
                              const std::array<Eigen::Vector3d, 3>& points);

}  // namespace megablock
