// Converts the attitude of the aircraft that carries a camera from and to yaw, pitch and roll. Many mapping programs
// exchange attitudes in this form.
//
// The body axes are x forward, y right, z down. The camera is taken as mounted like a nadir camera whose image has its
// top forward: body x is the camera's -y, body y the camera's x, body z its viewing direction. The angles turn the body
// from north, east, down (NED); with B the rotation body -> NED,
//
//     B = Rz(yaw) Ry(pitch) Rx(roll):    yaw clockwise from north, pitch nose up, roll right wing down.
//
// A nadir image has pitch = roll = 0, and its yaw is the direction of the image's top. The angles are singular where
// the camera looks along the horizon (pitch +-90 deg). The angles of a gimbal (YawPitchRoll in rotation.h) are singular
// at nadir instead, which makes them unsuitable for aerial images.
#pragma once

#include <Eigen/Geometry>

namespace megablock {

struct BodyAttitude {
  double yaw = 0, pitch = 0, roll = 0;  // radians; yaw and roll in (-pi, pi], pitch in [-pi/2, pi/2]
};
// Both convert between the angles and the rotation R_cw: ground (east, north, up) -> camera.
BodyAttitude body_attitude(const Eigen::Quaterniond& rotation_cw);
Eigen::Quaterniond rotation_from(const BodyAttitude& angles);

}  // namespace megablock
