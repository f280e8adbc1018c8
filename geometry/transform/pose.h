// Poses of frames and mounts, and the one chain from a ground point to a camera.
//
//     X_rig = R_frame (X - C_frame)
//     X_cam = R_mount (X_rig - C_mount)
//
// A pose is the rotation outside -> inside and the centre given outside: for a frame R_cw and the rig's origin in the
// ground frame (metres); for a mount the rotation rig -> camera and the camera's projection centre in the rig (metres).
// Subtract before rotating, always: ground coordinates are large.
#pragma once

#include "geometry/transform/rotation.h"

namespace megablock {

struct Pose {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();  // outside -> inside, unit
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();              // of the inside's origin, outside coordinates, metres
};

// Tangent increment of a pose: (rotation w [3, rad, right perturbation], centre [3, m]). The order of the six unknowns
// of a frame or mount everywhere.
using PoseIncrement = Eigen::Matrix<double, 6, 1>;

inline Pose pose_update(const Pose& pose, const PoseIncrement& d) {
  return {rotation_update(pose.rotation, d.head<3>()), pose.centre + d.tail<3>()};
}

template <typename Scalar>
Eigen::Matrix<Scalar, 3, 1> to_inside(const Eigen::Quaternion<Scalar>& rotation,
                                      const Eigen::Matrix<Scalar, 3, 1>& centre,
                                      const Eigen::Matrix<Scalar, 3, 1>& point) {
  const Eigen::Matrix<Scalar, 3, 1> difference = point - centre;
  return rotation * difference;
}

inline Eigen::Vector3d to_inside(const Pose& pose, const Eigen::Vector3d& point) {
  return to_inside<double>(pose.rotation, pose.centre, point);
}

// Pose of `inner` in the axes of `outer` (outer -> inner), both given from the ground.
inline Pose relative_to(const Pose& outer, const Pose& inner) {
  return {(inner.rotation * outer.rotation.conjugate()).normalized(), to_inside(outer, inner.centre)};
}

// Ground point to camera coordinates through frame and mount.
inline Eigen::Vector3d to_camera(const Pose& frame, const Pose& mount, const Eigen::Vector3d& point) {
  return to_inside(mount, to_inside(frame, point));
}

// Pose of a single camera in the ground frame: rotation ground -> camera and projection centre.
inline Pose camera_pose(const Pose& frame, const Pose& mount) {
  return {(mount.rotation * frame.rotation).normalized(), frame.centre + frame.rotation.conjugate() * mount.centre};
}

}  // namespace megablock
