#include "geometry/transform/body_attitude.h"

#include <algorithm>
#include <cmath>

#include "geometry/transform/rotation.h"

namespace megablock {

namespace {

// Camera axes from body axes for a camera that looks straight down: x = body y, y = -body x, z = body z.
const Eigen::Matrix3d kNadirCameraFromBody = (Eigen::Matrix3d() << 0, 1, 0, -1, 0, 0, 0, 0, 1).finished();

}  // namespace

BodyAttitude body_attitude(const Eigen::Quaterniond& rotation_cw) {
  // B = body -> NED, composed of body -> camera -> ground (ENU) -> NED. The angles follow from its elements:
  // B(0,0) = cos yaw cos pitch, B(1,0) = sin yaw cos pitch, B(2,0) = -sin pitch, B(2,1) = cos pitch sin roll,
  // B(2,2) = cos pitch cos roll.
  const Eigen::Matrix3d b = kEnuFromNed.transpose() * rotation_cw.toRotationMatrix().transpose() * kNadirCameraFromBody;
  return {std::atan2(b(1, 0), b(0, 0)), std::asin(std::clamp(-b(2, 0), -1.0, 1.0)), std::atan2(b(2, 1), b(2, 2))};
}

Eigen::Quaterniond rotation_from(const BodyAttitude& a) {
  const Eigen::Matrix3d b =
      (Eigen::AngleAxisd(a.yaw, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(a.pitch, Eigen::Vector3d::UnitY()) *
       Eigen::AngleAxisd(a.roll, Eigen::Vector3d::UnitX()))
          .toRotationMatrix();
  return Eigen::Quaterniond(Eigen::Matrix3d(kNadirCameraFromBody * b.transpose() * kEnuFromNed.transpose()))
      .normalized();
}

}  // namespace megablock
