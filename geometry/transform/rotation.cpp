#include "geometry/transform/rotation.h"

#include <algorithm>

namespace megablock {

Eigen::Matrix3d right_jacobian_inverse(const Eigen::Vector3d& w) {
  const double angle_squared = w.squaredNorm();
  const Eigen::Matrix3d k = skew<double>(w);
  double factor = 1.0 / 12 + angle_squared / 720;  // the closed form is 0 / 0 at zero; this is its series
  if (angle_squared > 1e-6) {
    const double angle = std::sqrt(angle_squared);
    factor = 1 / angle_squared - (1 + std::cos(angle)) / (2 * angle * std::sin(angle));
  }
  return Eigen::Matrix3d::Identity() + 0.5 * k + factor * k * k;
}

double rotation_angle(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
  return rotation_log<double>(a.conjugate() * b).norm();
}

namespace {

// Camera axes (x right, y down, z forward) from image axes (x right, y up, looking along -z).
const Eigen::Matrix3d kCameraFromPhoto = Eigen::Vector3d(1, -1, -1).asDiagonal();

Eigen::Matrix3d axis_rotation(double angle, const Eigen::Vector3d& axis) {
  return Eigen::AngleAxisd(angle, axis).toRotationMatrix();
}

// Camera axes from body axes (x forward, y right, z down): camera x = body y, y = body z, z = body x.
const Eigen::Matrix3d kCameraFromBody = (Eigen::Matrix3d() << 0, 1, 0, 0, 0, 1, 1, 0, 0).finished();

}  // namespace

const Eigen::Matrix3d kEnuFromNed = (Eigen::Matrix3d() << 0, 1, 0, 1, 0, 0, 0, 0, -1).finished();

// M = Rx(omega) Ry(phi) Rz(kappa) turns image axes into ground axes. The angles follow from its elements: M(0,2) = sin
// phi, M(1,2) = -sin omega cos phi, M(2,2) = cos omega cos phi, M(0,1) = -cos phi sin kappa, M(0,0) = cos phi cos
// kappa.
OmegaPhiKappa omega_phi_kappa(const Eigen::Quaterniond& rotation_cw) {
  const Eigen::Matrix3d m = rotation_cw.toRotationMatrix().transpose() * kCameraFromPhoto;
  return {std::atan2(-m(1, 2), m(2, 2)), std::asin(std::clamp(m(0, 2), -1.0, 1.0)), std::atan2(-m(0, 1), m(0, 0))};
}

Eigen::Quaterniond rotation_from(const OmegaPhiKappa& a) {
  const Eigen::Matrix3d m = axis_rotation(a.omega, Eigen::Vector3d::UnitX()) *
                            axis_rotation(a.phi, Eigen::Vector3d::UnitY()) *
                            axis_rotation(a.kappa, Eigen::Vector3d::UnitZ());
  return Eigen::Quaterniond(Eigen::Matrix3d(kCameraFromPhoto * m.transpose())).normalized();
}

// B = Rz(yaw) Ry(pitch) Rx(roll) turns body axes into NED; see body_attitude.cpp for its elements.
YawPitchRoll yaw_pitch_roll(const Eigen::Quaterniond& rotation_cw) {
  const Eigen::Matrix3d b = kEnuFromNed.transpose() * rotation_cw.toRotationMatrix().transpose() * kCameraFromBody;
  return {std::atan2(b(1, 0), b(0, 0)), std::asin(std::clamp(-b(2, 0), -1.0, 1.0)), std::atan2(b(2, 1), b(2, 2))};
}

Eigen::Quaterniond rotation_from(const YawPitchRoll& a) {
  const Eigen::Matrix3d b = axis_rotation(a.yaw, Eigen::Vector3d::UnitZ()) *
                            axis_rotation(a.pitch, Eigen::Vector3d::UnitY()) *
                            axis_rotation(a.roll, Eigen::Vector3d::UnitX());
  return Eigen::Quaterniond(Eigen::Matrix3d(kCameraFromBody * b.transpose() * kEnuFromNed.transpose())).normalized();
}

}  // namespace megablock
