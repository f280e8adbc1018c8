// Gives the coplanarity determinant of a match between two cameras of known positions, with its ten derivatives. It is
// an observation of the attitudes that needs no object point (A. Barrier and S. Martin, "Bundle adjustment with known
// positions", report, ENS Paris-Saclay).
//
// Let d_1 and d_2 be the rays of one point in ground axes, not normalised, and m = C_2 - C_1 the base. The three are
// coplanar:
//
//     F = m . (d_1 x d_2) = 0,        |F| = (shortest distance between the rays) |d_1 x d_2|.
//
// A camera looks along +z, has the focal length f, and its image coordinates start at the principal point. The attitude
// is a sequence of rotations about the fixed axes of the ground, first X (alpha), then Y (beta), then Z (gamma):
// R = Rz(gamma) Ry(beta) Rx(alpha), ground -> camera. With u = cos(gamma) x + sin(gamma) y, v = -sin(gamma)
// x + cos(gamma) y and w = sin(beta) u + f cos(beta), the ray is
//
//     f d = (cos(beta) u - f sin(beta), cos(alpha) v + sin(alpha) w, -sin(alpha) v + cos(alpha) w)
//
// The derivatives printed in the report contain four mistakes; those here are derived from this form. Degenerate cases:
// beta = +-90 deg, where alpha and gamma turn about the same axis; a zero base, where F is zero whatever the angles.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace megablock {

struct XyzAngles {
  double alpha = 0, beta = 0, gamma = 0;  // radians
};
// Angles of a rotation ground -> camera, with beta in [-pi/2, pi/2]; and the rotation of angles.
XyzAngles xyz_angles(const Eigen::Quaterniond& rotation_cw);
Eigen::Quaterniond rotation_from(const XyzAngles& angles);

// Ray of an image point (pixels from the principal point) in ground axes, times the focal length (pixels), and its
// derivatives by alpha, beta, gamma, x, y.
struct AngledRay {
  Eigen::Vector3d direction;
  Eigen::Matrix<double, 3, 5> derivatives;
};
AngledRay angled_ray(const XyzAngles& angles, const Eigen::Vector2d& image, double focal);

struct CoplanarityDeterminant {
  double value = 0;                                 // in the units of the base
  Eigen::Matrix<double, 1, 5> by_first, by_second;  // alpha, beta, gamma, x, y of either camera
};
// Evaluates F and its derivatives for one match. Both images share the focal length (pixels). F is computed with rays
// of unit depth, that is divided by focal^2.
CoplanarityDeterminant coplanarity_determinant(const Eigen::Vector3d& base, double focal, const XyzAngles& first,
                                               const Eigen::Vector2d& image_first, const XyzAngles& second,
                                               const Eigen::Vector2d& image_second);

}  // namespace megablock
