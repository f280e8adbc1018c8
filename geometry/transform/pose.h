// Gives the poses of frames and mounts, and the one chain of transformations from a ground point to a camera.
//
//     X_rig = R_frame (X - C_frame)
//     X_cam = R_mount (X_rig - C_mount)
//
// A pose consists of the rotation outside -> inside and the centre in outside coordinates. For a frame, outside is the
// ground and inside the rig: the rotation R_cw and the position of the rig's origin in the ground frame (metres). For a
// mount, outside is the rig and inside the camera: the rotation rig -> camera and the camera's projection centre in the
// rig (metres).
//
// Always subtract the centre before rotating. Ground coordinates are of the order of 10^6 m; a rotation of them would
// lose six digits.
#pragma once

#include "geometry/transform/rotation.h"

namespace megablock {

struct Pose {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();  // outside -> inside, unit quaternion
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();              // origin of the inside, in outside coordinates, metres
};

// Tangent increment of a pose: (w, d), w the right perturbation of the rotation (3, radians, see rotation.h) and d the
// shift of the centre (3, metres). All unknowns of a frame or a mount have this order.
using PoseIncrement = Eigen::Matrix<double, 6, 1>;

// The pose moved by an increment.
inline Pose pose_update(const Pose& pose, const PoseIncrement& d) {
  return {rotation_update(pose.rotation, d.head<3>()), pose.centre + d.tail<3>()};
}

// Inside coordinates of a point: R (X - C).
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

// Pose of `inner` relative to `outer` (rotation outer -> inner, centre in axes of `outer`). Both are given from the
// ground.
inline Pose relative_to(const Pose& outer, const Pose& inner) {
  return {(inner.rotation * outer.rotation.conjugate()).normalized(), to_inside(outer, inner.centre)};
}

// Camera coordinates of a ground point, by way of frame and mount.
inline Eigen::Vector3d to_camera(const Pose& frame, const Pose& mount, const Eigen::Vector3d& point) {
  return to_inside(mount, to_inside(frame, point));
}

// Pose of one camera of a rig in the ground frame: rotation ground -> camera, and its projection centre.
inline Pose camera_pose(const Pose& frame, const Pose& mount) {
  return {(mount.rotation * frame.rotation).normalized(), frame.centre + frame.rotation.conjugate() * mount.centre};
}

}  // namespace megablock
