// Relative orientation of two calibrated images from five points: up to ten essential matrices, forty orientations.
//
// The five coplanarity equations leave E = x E1 + y E2 + z E3 + E4. It is essential if
//
//     det E = 0,    2 E E' E - tr(E E') E = 0:
//
// ten cubics in x, y, z. Gauss-Jordan elimination of x^3, y^3, x^2 y, x y^2, x^2 z, x^2, y^2 z, y^2, xyz, xy leaves, in
// three pairs of rows, only terms linear in x and y; a row of x^2 less z times... gives three equations
//
//     k_j(z) x + l_j(z) y + m_j(z) = 0,    degrees 3, 3, 4,
//
// whose determinant is of degree ten in z (D. Nister, "An efficient solution to the five-point relative pose problem",
// IEEE PAMI 26(6), 2004). This is the same variety as the direct system of Kalantari (2009, M40: rotation by Thompson's
// parameters and unit base, forty solutions = ten essential matrices, two rotations, two signs of the base). The basis
// E1 to E4 is mixed by a fixed rotation, so that structured scenes (no rotation, base along an axis) do not lie at
// infinity. Where the elimination is ill-conditioned, as with short bases, the determinant loses the solutions; the ten
// cubic monomials are then reduced to the others, and the solutions are eigenvectors of the multiplication with z (H.
// Stewenius, C. Engels and D. Nister, "Recent developments on direct relative orientation", ISPRS J. 60, 2006): five
// times as slow, some per cent of samples. Every orientation is polished by Newton iterations on the five equations in
// rotation and base.
//
// Degenerate: no base (any base fits the true rotation); five points in one plane with the base. The base perpendicular
// to the plane of the points is a double root, where errors grow as the root of those of the rays and one sample in a
// hundred without noise misses the truth.
#pragma once

#include <Eigen/Core>
#include <array>

#include "geometry/two_view/relative_orientation.h"

namespace megablock {

using FiveRays = std::array<Eigen::Vector3d, 5>;

// Unit rays. All orientations, behind the images or not, those of one essential matrix in a row. A few per cent of
// samples have one essential matrix twice, where polishing leads from two starts to one solution. Empty for points that
// coincide, and where something is not a number.
Solutions<RelativeOrientation, 40> solve_five_point(const FiveRays& a, const FiveRays& b);

// Only those with the five points in front of both images.
Solutions<RelativeOrientation, 10> solve_five_point_in_front(const FiveRays& a, const FiveRays& b);

}  // namespace megablock
