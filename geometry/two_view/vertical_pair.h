// Finds the relative orientation of two images whose verticals are known, from three points. There are up to four
// solutions.
//
// The rays of each image are levelled first (vertical.h), so that the vertical becomes the axis Y (Kalantari 2009,
// chapter 8). Of the rotation only a turn p about Y remains unknown. Three points are coplanar with the base t if
//
//     c_i(p) . t = 0,    c_i(p) = (R_Y(p) a_i) x b_i,    R_Y(p) = [cos p, 0, -sin p; 0, 1, 0; sin p, 0, cos p],
//
// so det(c_1, c_2, c_3) = 0. With s = tan(p/2), multiplication by 1 + s^2 makes each row quadratic in s:
//
//     (a_y b_z - a_z b_y) - 2 a_x b_y s + (a_y b_z + a_z b_y) s^2
//     (a_z b_x - a_x b_z) + 2 (a_x b_x + a_z b_z) s - (a_z b_x - a_x b_z) s^2
//     (a_x b_y - a_y b_x) - 2 a_z b_y s - (a_x b_y + a_y b_x) s^2
//
// The determinant has degree six and always contains the factor 1 + s^2, which leaves a quartic. (The system printed in
// annex C of the thesis, with twelve solutions, is wrong.) The roots are found projectively, so that a turn by 180
// degrees is no special case. The base is the longest cross product of two rows; its sign is the one with the points in
// front.
//
// Degenerate cases: the three points in one plane with the base. At the true turn all rows are then parallel to the
// normal of this plane, the root is double, and any base in the plane fits; the result may be empty or meaningless.
// Points off the plane by a thousandth of their distance give the truth again. No base: empty where it is exactly zero
// (rotation_pair.h then finds the rotation from two rays). Base perpendicular to the plane of the points: two roots
// coincide, and errors grow as the square root of the errors of the rays.
#pragma once

#include <Eigen/Core>
#include <array>

#include "geometry/two_view/relative_orientation.h"

namespace megablock {

// `a` and `b` are unit rays of three points in camera axes. `vertical_a` and `vertical_b` are the vertical direction in
// the same axes, unit vectors, both up or both down. Every solution has the three points in front of both images (to
// rounding where their rays are parallel) and its rays in a plane with the base to within a microradian. Empty for
// points that coincide and for input that is not finite.
Solutions<RelativeOrientation, 4> solve_vertical_pair(const std::array<Eigen::Vector3d, 3>& a,
                                                      const std::array<Eigen::Vector3d, 3>& b,
                                                      const Eigen::Vector3d& vertical_a,
                                                      const Eigen::Vector3d& vertical_b);

}  // namespace megablock
