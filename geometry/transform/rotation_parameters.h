// Gives parameters of a rotation and of a unit base that turn the equations of relative orientation and of similarity
// into polynomials (Kalantari 2009, chapter 7). Only minimal solvers need them; all other code uses the increments of
// rotation.h.
//
// Cayley's parameters are v = axis * tan(angle / 2), with R = (I - [v]x)^-1 (I + [v]x). Thompson's parameters (1959)
// are twice those of Cayley. Both are the vector part of the quaternion over its real part, and become infinite for a
// rotation by 180 degrees.
//
// A unit base t has the parameters (u, v) by stereographic projection from the pole (0, 0, 1), which itself maps to
// infinity:
//
//     t = (2u, 2v, u^2 + v^2 - 1) / (u^2 + v^2 + 1),      (u, v) = (t_x, t_y) / (1 - t_z).
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace megablock {

inline Eigen::Vector3d cayley_parameters(const Eigen::Quaterniond& q) { return q.vec() / q.w(); }
inline Eigen::Quaterniond rotation_from_cayley(const Eigen::Vector3d& v) {
  return Eigen::Quaterniond(1, v.x(), v.y(), v.z()).normalized();
}

inline Eigen::Vector3d thompson_parameters(const Eigen::Quaterniond& q) { return 2 * cayley_parameters(q); }
inline Eigen::Quaterniond rotation_from_thompson(const Eigen::Vector3d& v) { return rotation_from_cayley(0.5 * v); }

inline Eigen::Vector2d stereographic_parameters(const Eigen::Vector3d& base) { return base.head<2>() / (1 - base.z()); }
inline Eigen::Vector3d base_from_stereographic(const Eigen::Vector2d& p) {
  const double square = p.squaredNorm();
  return Eigen::Vector3d(2 * p.x(), 2 * p.y(), square - 1) / (square + 1);
}

}  // namespace megablock
