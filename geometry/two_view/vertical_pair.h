// Relative orientation of two images with known vertical from three points: up to four solutions.
//
// Each image's rays are levelled (vertical.h), so that the vertical becomes the axis Y (Kalantari 2009, M46). What is
// left of the rotation is a turn p about Y, and three points are coplanar with the base t if
//
//     c_i(p) . t = 0,    c_i(p) = (R_Y(p) a_i) x b_i,    R_Y(p) = [cos p, 0, -sin p; 0, 1, 0; sin p, 0, cos p],
//
// so det(c_1, c_2, c_3) = 0. With s = tan(p/2) and after multiplication by 1 + s^2 each row is quadratic in s:
//
//     (a_y b_z - a_z b_y) - 2 a_x b_y s + (a_y b_z + a_z b_y) s^2
//     (a_z b_x - a_x b_z) + 2 (a_x b_x + a_z b_z) s - (a_z b_x - a_x b_z) s^2
//     (a_x b_y - a_y b_x) - 2 a_z b_y s - (a_x b_y + a_y b_x) s^2
//
// and the determinant, of degree six, has the factor 1 + s^2 always; a quartic is left (the printed system of the
// thesis, annex C, with twelve solutions, is wrong). Its roots are sought projectively, as a turn by 180 deg is none
// the worse than another. The base is the longest cross product of two rows, its sign the one with the points in front.
//
// Degenerate: the three points and the base in one plane, to whose normal all rows are parallel at the true turn, a
// double root: any base in the plane fits. Nothing may be found there, or orientations that fulfil the equations and
// mean nothing; points off the plane by a thousandth of their distance give the truth again. No base (empty where it is
// exactly zero; two rays then give the rotation, rotation_pair.h). Where the base is perpendicular to the plane of the
// points two roots coincide, and errors grow as the root of those of the rays.
#pragma once

#include <Eigen/Core>
#include <array>

#include "geometry/two_view/relative_orientation.h"

namespace megablock {

// `a`, `b`: unit rays of three points in the images' axes; `vertical_a`, `vertical_b`: the same vertical direction in
// them, both up or both down, unit. Every solution has the three points in front of both images, to rounding where
// their rays are parallel, and their rays in a plane with the base within a microradian. Empty for points that
// coincide, and where something is not a number.
Solutions<RelativeOrientation, 4> solve_vertical_pair(const std::array<Eigen::Vector3d, 3>& a,
                                                      const std::array<Eigen::Vector3d, 3>& b,
                                                      const Eigen::Vector3d& vertical_a,
                                                      const Eigen::Vector3d& vertical_b);

}  // namespace megablock
