// Pose of a rig from three points seen by any of its cameras (generalised three-point problem), up to eight solutions.
//
// A ray of the rig starts at o_i and runs along d_i; the point on it lies at o_i + s_i d_i in the rig. Lengths are
// kept:
//
//     |o_i + s_i d_i - o_j - s_j d_j|^2 = |X_i - X_j|^2      (i, j) = (1,2), (1,3), (2,3)
//
// three quadrics in the distances s. The first two are monic quadratics in s_2 and in s_3 with coefficients in s_1;
// with them the third becomes bilinear in s_2 and s_3, and both are eliminated: an octic in s_1 (Nister and Stewenius,
// "A minimal solution to the generalised 3-point pose problem", J. Math. Imaging Vision 27, 2007, have the same degree
// from two circles on a ruled surface). Distances are polished by Newton iterations on the three quadrics.
//
// Degenerate: points on one line; three parallel rays, along which the rig slides. Two solutions coincide where the
// triangle of the points can move to first order with each of its corners along its ray: for one centre that is the
// danger cylinder (p3p.h). Errors there grow as the root of those of the rays.
#pragma once

#include <Eigen/Core>
#include <array>

#include "geometry/numbers/solutions.h"
#include "geometry/transform/pose.h"

namespace megablock {

// `origins` [m], unit `directions`: in the rig; `points`: in the ground frame, metres, same order. Poses ground -> rig
// with all points in front of their cameras. Rays from one centre are left to solve_p3p. Empty for points on one line,
// for rays that are parallel or opposite within 1e-9, and where there is no solution.
Solutions<Pose, 8> solve_gp3p(const std::array<Eigen::Vector3d, 3>& origins,
                              const std::array<Eigen::Vector3d, 3>& directions,
                              const std::array<Eigen::Vector3d, 3>& points);

}  // namespace megablock
