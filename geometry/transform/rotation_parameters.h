// Parameters of rotations and of unit bases in which relative orientation and similarity become polynomials (Kalantari
// 2009, M37, M38). rotation.h is what everything else uses.
//
// Cayley, (x, y, z) = axis tan(angle / 2), R = (I - [v]x)^-1 (I + [v]x); Thompson (1959), twice that. Both are the
// vector part of the quaternion over its real part, and infinite for half turns. A unit base t is (u, v) by
// stereographic projection from the pole (0, 0, 1), which itself is at infinity:
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
