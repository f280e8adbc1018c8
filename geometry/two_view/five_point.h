// Finds the relative orientation of two calibrated images from five points. There are up to ten essential matrices, and
// each has four orientations.
//
// The five coplanarity equations b' E a = 0 are linear in E and leave E = x E1 + y E2 + z E3 + E4. E is essential if
//
//     det E = 0,    2 E E' E - tr(E E') E = 0:
//
// These are ten cubics in x, y, z. Gauss-Jordan elimination of x^3, y^3, x^2 y, x y^2, x^2 z, x^2, y^2 z, y^2, xyz, xy
// leaves six rows, in pairs, whose other terms are linear in x and y. The row of x^2 z minus z times the row of x^2,
// and likewise for y^2 and xy, gives three equations
//
//     k_j(z) x + l_j(z) y + m_j(z) = 0,    degrees 3, 3, 4,
//
// Their determinant has degree ten in z (D. Nister, "An efficient solution to the five-point relative pose problem",
// IEEE PAMI 26(6), 2004). The direct system of Kalantari (2009, chapter 7), in Thompson's parameters of the rotation
// and a unit base, has the same solutions: forty, which are ten essential matrices with two rotations and two signs of
// the base each.
//
// A fixed rotation mixes the basis E1 to E4. Without it, structured scenes (no rotation, base along an axis) would have
// their solution at infinity.
//
// Where the elimination is ill-conditioned, as for short bases, the determinant loses solutions. All ten cubic
// monomials are then expressed by the lower ones, and the solutions are eigenvectors of the multiplication by z (H.
// Stewenius, C. Engels and D. Nister, "Recent developments on direct relative orientation", ISPRS J. 60, 2006). This
// takes five times as long and happens for some per cent of the samples.
//
// Newton's iteration on the five equations in rotation and base polishes every orientation.
//
// Degenerate cases: no base (any base fits the true rotation); five points in one plane with the base. If the base is
// perpendicular to a plane that contains the points, the solution is a double root. Errors there grow as the square
// root of the errors of the rays, and one exact sample in a hundred misses the truth.
#pragma once

#include <Eigen/Core>
#include <array>

#include "geometry/two_view/relative_orientation.h"

namespace megablock {

using FiveRays = std::array<Eigen::Vector3d, 5>;

// Returns all orientations a -> b from unit rays, with the points in front or behind; the four of one essential matrix
// are adjacent. In a few per cent of the samples polishing leads from two starts to the same essential matrix, which is
// then returned twice. Empty for points that coincide and for input that is not finite.
Solutions<RelativeOrientation, 40> solve_five_point(const FiveRays& a, const FiveRays& b);

// Returns only the orientations with all five points in front of both images.
Solutions<RelativeOrientation, 10> solve_five_point_in_front(const FiveRays& a, const FiveRays& b);

}  // namespace megablock
