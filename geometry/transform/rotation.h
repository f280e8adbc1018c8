// Gives rotations as unit quaternions for storage and as tangent increments (rotation vectors) for estimation. A
// quaternion has four numbers for three degrees of freedom; an increment has three and needs no constraint.
//
// This convention holds in the whole project. The rotation R of a frame is R_cw: world -> camera (or rig). An increment
// w (3-vector, radians) acts as a RIGHT perturbation:
//
//     R(w) = R * Exp(w),      Exp(w) = I + [w]x + ...   (Rodrigues)
//
// So w turns the world axes, and the derivative of R X by w is -R [X]x at w = 0. Files store quaternions as (w, x, y,
// z). Eigen's constructor takes the same order; its .coeffs() returns (x, y, z, w).
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>

namespace megablock {

// Cross-product matrix: skew(a) * b = a x b.
template <typename Scalar>
Eigen::Matrix<Scalar, 3, 3> skew(const Eigen::Matrix<Scalar, 3, 1>& a) {
  Eigen::Matrix<Scalar, 3, 3> m;
  m << Scalar(0), -a.z(), a.y(), a.z(), Scalar(0), -a.x(), -a.y(), a.x(), Scalar(0);
  return m;
}

// Unit quaternion of the rotation vector w (radians): (cos |w|/2, sin(|w|/2) w / |w|). Near zero a series replaces the
// quotient, so that the function and its derivatives are exact there; automatic differentiation needs this.
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

// Rotation vector of a unit quaternion, with |w| <= pi; the inverse of rotation_exp. A negative real part is made
// positive first: q and -q are the same rotation, and the shorter way is wanted.
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

// R Exp(w), normalised. Every estimated rotation is updated by this function.
inline Eigen::Quaterniond rotation_update(const Eigen::Quaterniond& rotation, const Eigen::Vector3d& w) {
  return (rotation * rotation_exp<double>(w)).normalized();
}

// Inverse of the right Jacobian of SO(3): Log(R Exp(d)) = Log(R) + right_jacobian_inverse(Log(R)) d + O(d^2). With
// k = [w]x and the angle t = |w| it is I + k / 2 + (1 / t^2 - (1 + cos t) / (2 t sin t)) k^2.
Eigen::Matrix3d right_jacobian_inverse(const Eigen::Vector3d& w);

// Angle of the rotation that turns one attitude into the other, radians in [0, pi].
double rotation_angle(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b);

// Turns coordinates north, east, down (NED) into east, north, up (ENU), the axes of the ground frame. It is its own
// inverse.
extern const Eigen::Matrix3d kEnuFromNed;

// Photogrammetric angles omega, phi, kappa in radians: Rx(omega) Ry(phi) Rz(kappa) turns the image axes (x right, y up,
// looking along -z) into the ground axes. The functions convert from and to R_cw, whose camera axes are x right, y
// down, z along the view. Singular at phi = +-90 deg.
struct OmegaPhiKappa {
  double omega, phi, kappa;
};
OmegaPhiKappa omega_phi_kappa(const Eigen::Quaterniond& rotation_cw);
Eigen::Quaterniond rotation_from(const OmegaPhiKappa& angles);

// Angles of the camera's viewing direction as a gimbal reports them, radians: yaw clockwise from north, pitch upward,
// roll right side down. With yaw = pitch = roll = 0 the camera looks north along the horizon; pitch = -90 deg is nadir.
// There the angles are singular; body_attitude.h has angles for nadir images.
struct YawPitchRoll {
  double yaw, pitch, roll;
};
YawPitchRoll yaw_pitch_roll(const Eigen::Quaterniond& rotation_cw);
Eigen::Quaterniond rotation_from(const YawPitchRoll& angles);

}  // namespace megablock
