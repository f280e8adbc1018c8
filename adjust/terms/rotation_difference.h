// Gives Log(R R_0') and its derivative by the right perturbation of R, for observed rotations:
//
//   Log(R Exp(w) R_0') = Log(E Exp(R_0 w)),  E = R R_0':   by w: J_r^-1(Log E) R_0
#pragma once

#include "geometry/transform/rotation.h"

namespace megablock {

struct RotationDifference {
  Eigen::Vector3d value;  // radians, about the rotated axes
  Eigen::Matrix3d by_rotation;
};
inline RotationDifference rotation_difference(const Eigen::Quaterniond& rotation, const Eigen::Quaterniond& reference) {
  const Eigen::Vector3d value = rotation_log<double>(rotation * reference.conjugate());
  return {value, right_jacobian_inverse(value) * reference.toRotationMatrix()};
}

}  // namespace megablock
