// Coplanarity determinant of two cameras of known positions, and its ten derivatives (KP-03): an observation without
// the point.
//
// The rays of one point, d_1 and d_2 [axes of the ground, not normalised], and the base m = C_2 - C_1 lie in a plane:
//
//     F = m . (d_1 x d_2) = 0,        |F| = (shortest distance between the rays) |d_1 x d_2|.
//
// A camera looks along +z with the focal length f and the image origin at the principal point; angles are about the
// fixed axes of the ground, first X (alpha), then Y (beta), then Z (gamma):  R = Rz(gamma) Ry(beta) Rx(alpha), ground
// -> camera. With u = cos(gamma) x + sin(gamma) y, v = -sin(gamma) x + cos(gamma) y, w = sin(beta) u + f cos(beta) the
// ray is
//
//     f d = (cos(beta) u - f sin(beta), cos(alpha) v + sin(alpha) w, -sin(alpha) v + cos(alpha) w)
//
// (A. Barrier and S. Martin; their printed derivatives have four mistakes, those here follow from this form).
// Singular: beta = +-90 deg, where alpha and gamma turn about the same axis. No base: F is zero whatever the angles.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace megablock {

struct XyzAngles {
  double alpha = 0, beta = 0, gamma = 0;  // radians
};
// beta in [-pi/2, pi/2].
XyzAngles xyz_angles(const Eigen::Quaterniond& rotation_cw);
Eigen::Quaterniond rotation_from(const XyzAngles& angles);

// The ray of an image point (pixels from the principal point), times the focal length, and its derivatives by alpha,
// beta, gamma, x, y.
struct AngledRay {
  Eigen::Vector3d direction;
  Eigen::Matrix<double, 3, 5> derivatives;
};
AngledRay angled_ray(const XyzAngles& angles, const Eigen::Vector2d& image, double focal);

struct CoplanarityDeterminant {
  double value = 0;                                 // in the units of the base
  Eigen::Matrix<double, 1, 5> by_first, by_second;  // alpha, beta, gamma, x, y of either camera
};
CoplanarityDeterminant coplanarity_determinant(const Eigen::Vector3d& base, double focal, const XyzAngles& first,
                                               const Eigen::Vector2d& image_first, const XyzAngles& second,
                                               const Eigen::Vector2d& image_second);

}  // namespace megablock
