// The camera of BAL and Bundler files (Snavely et al. 2006; Agarwal et al. 2010), and ours.
//
// Theirs:   P = R X + t,  p = -P / P.z,  p' = f (1 + k1 |p|^2 + k2 |p|^4) p
// looking along -z, x right, y up, the image's origin at the principal point. Ours looks along +z with y down, so with
// S = diag(1, -1, -1):
//     R = S R_cw,  t = -S R_cw C,  p = (X/Z, -Y/Z)_ours,  p' = (u - cx, cy - v)
// k3, p1, p2 and corrections of other models have no place there: an observation of a camera that has them is taken out
// of our image (unproject) and put into theirs with f, k1, k2 (0 for other models), so that its ray is the same;
// without them it is the same pixel exactly. Fisheyes and panoramas are refused. The principal point is not kept by the
// files. Internal to io/.
#pragma once

#include <optional>
#include <string>

#include "geometry/camera/camera.h"
#include "geometry/transform/pose.h"

namespace megablock {

struct BalCamera {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  double focal = 1, k1 = 0, k2 = 0;
};

// Throws InputError naming the camera when it is of a model without a plane image.
void check_bal_model(const std::string& camera, const CameraModel& model);
BalCamera to_bal(const Pose& camera_in_ground, const Intrinsics& intrinsics);
Pose pose_from_bal(const BalCamera& camera);

// Our pixel in their image coordinates; empty where our distortion cannot be inverted.
std::optional<Eigen::Vector2d> to_bal_image(const Intrinsics& intrinsics, const Eigen::Vector2d& pixel);

}  // namespace megablock
