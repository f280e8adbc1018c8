// Rotations: unit quaternions in storage, tangent increments in estimation.
//
// Convention, stated here once for the whole project. A frame's rotation R is R_cw: world -> camera (or rig).
// An increment w (3-vector, radians) acts by the RIGHT perturbation
//
//     R(w) = R * Exp(w),      Exp(w) = I + [w]x + ...   (Rodrigues)
//
// so w is a rotation of the world axes, and d(R X)/dw = -R [X]x at w = 0. Quaternions are (w, x, y, z) in files;
// Eigen's constructor takes the same order, its .coeffs() does not (x, y, z, w).
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>

namespace megablock {

// The cross-product matrix: skew(a) * b = a x b.
template <typename Scalar>
Eigen::Matrix<Scalar, 3, 3> skew(const Eigen::Matrix<Scalar, 3, 1>& a) {
  Eigen::Matrix<Scalar, 3, 3> m;
  m << Scalar(0), -a.z(), a.y(), a.z(), Scalar(0), -a.x(), -a.y(), a.x(), Scalar(0);
  return m;
}

// Quaternion of the rotation vector w; series near zero, so that it is exact and differentiable there.
template <typename Scalar>
Eigen::Quaternion<Scalar> rotation_exp(const Eigen::Matrix<Scalar, 3, 1>& w) {
  using std::cos;
  using std::sin;
  using std::sqrt;
  const Scalar angle_squared = w.squaredNorm();
  Scalar real, factor;
  if (angle_squared > Scalar(1e-8)) {
    const Scalar half = sqrt(angle_squared) * Scalar(0.5);
    real = cos(half);
    factor = sin(half) / (half * Scalar(2));
  } else {
    real = Scalar(1) - angle_squared / Scalar(8);
    factor = Scalar(0.5) - angle_squared / Scalar(48);
  }
  return Eigen::Quaternion<Scalar>(real, factor * w.x(), factor * w.y(), factor * w.z());
}

// Rotation vector of a unit quaternion, |w| <= pi. Inverse of rotation_exp.
template <typename Scalar>
Eigen::Matrix<Scalar, 3, 1> rotation_log(const Eigen::Quaternion<Scalar>& q) {
  using std::atan2;
  using std::sqrt;
  const Scalar sign = q.w() < Scalar(0) ? Scalar(-1) : Scalar(1);
  const Scalar real = sign * q.w();
  const Eigen::Matrix<Scalar, 3, 1> imaginary = q.vec() * sign;
  const Scalar norm_squared = imaginary.squaredNorm();
  if (norm_squared < Scalar(1e-16)) return imaginary * (Scalar(2) / real);
  const Scalar norm = sqrt(norm_squared);
  return imaginary * (Scalar(2) * atan2(norm, real) / norm);
}

// R * Exp(w), normalised: the one way an estimated rotation is updated.
inline Eigen::Quaterniond rotation_update(const Eigen::Quaterniond& rotation, const Eigen::Vector3d& w) {
  return (rotation * rotation_exp<double>(w)).normalized();
}

// Inverse of the right Jacobian of SO(3): Log(R Exp(d)) ~ Log(R) + right_jacobian_inverse(Log(R)) d.
Eigen::Matrix3d right_jacobian_inverse(const Eigen::Vector3d& w);

// Angle of the rotation between two attitudes, radians in [0, pi].
double rotation_angle(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b);

// East, north, up of north, east, down.
extern const Eigen::Matrix3d kEnuFromNed;

// Photogrammetric omega-phi-kappa (radians): R_cw(photo, y up, looking along -z) = Rk Rp Ro; and the navigation
// yaw-pitch-roll of a body (x forward, y right, z down) in NED. Both refer to the camera of architecture.md
// (x right, y down, looking along +z); see rotation.cpp for the axis changes.
struct OmegaPhiKappa {
  double omega, phi, kappa;
};
OmegaPhiKappa omega_phi_kappa(const Eigen::Quaterniond& rotation_cw);
Eigen::Quaterniond rotation_from(const OmegaPhiKappa& angles);

// yaw clockwise from north, pitch up positive, roll right wing down positive; of the camera's viewing direction as
// a gimbal reports it: yaw = pitch = roll = 0 looks north along the horizon, pitch = -90 deg is nadir.
struct YawPitchRoll {
  double yaw, pitch, roll;
};
YawPitchRoll yaw_pitch_roll(const Eigen::Quaterniond& rotation_cw);
Eigen::Quaterniond rotation_from(const YawPitchRoll& angles);

}  // namespace megablock
