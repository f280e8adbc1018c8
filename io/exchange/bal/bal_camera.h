// Converts cameras and observations between our conventions and those of BAL and Bundler files (Snavely et al. 2006;
// Agarwal et al. 2010). Internal to io/.
//
// Their camera looks along -z, with x right and y up, and the origin of its image is the principal point:
//
//     P = R X + t,  p = -P / P.z,  p' = f (1 + k1 |p|^2 + k2 |p|^4) p
//
// Ours looks along +z with y down. With S = diag(1, -1, -1) follows:
//
//     R = S R_cw,  t = -S R_cw C,  p = (X/Z, -Y/Z)_ours,  p' = (u - cx, cy - v)
//
// The files cannot hold k3, p1, p2, b1, b2 and the corrections of other models. An observation of a camera with such
// parameters is therefore converted to its ray (unproject) and projected with f, k1, k2 (0 for other models), so its
// ray stays the same. Without such parameters it stays exactly the same pixel. Fisheyes and panoramas are refused. The
// files do not hold the principal point.
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

// Throws InputError with the name of the camera if its model has no plane image.
void check_bal_model(const std::string& camera, const CameraModel& model);
BalCamera to_bal(const Pose& camera_in_ground, const Intrinsics& intrinsics);
Pose pose_from_bal(const BalCamera& camera);

// Our pixel in their image coordinates. Empty where our distortion cannot be inverted.
std::optional<Eigen::Vector2d> to_bal_image(const Intrinsics& intrinsics, const Eigen::Vector2d& pixel);

}  // namespace megablock
