// Attitude of the aircraft that carries a camera, as mapping programs exchange it.
//
// The body (x forward, y right, z down) belongs to the camera as that of a nadir photo whose top is forward: body x is
// the camera's -y, body y its x, body z its viewing direction. The angles turn the body from north, east, down, with
// body -> NED  B = Rz(yaw) Ry(pitch) Rx(roll):
//
//     yaw clockwise from north, pitch nose up, roll right wing down
//
// so a nadir photo has pitch = roll = 0 and its yaw is where the image's top points. Singular where the camera looks
// along the horizon (pitch +-90 deg); the gimbal angles of rotation.h are singular at nadir instead.
#pragma once

#include <Eigen/Geometry>

namespace megablock {

struct BodyAttitude {
  double yaw = 0, pitch = 0, roll = 0;  // radians; yaw and roll in (-pi, pi], pitch in [-pi/2, pi/2]
};
BodyAttitude body_attitude(const Eigen::Quaterniond& rotation_cw);
Eigen::Quaterniond rotation_from(const BodyAttitude& angles);

}  // namespace megablock
