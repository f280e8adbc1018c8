// An image measurement as a ray of its rig, with residuals in pixels for any camera model.
//
// A pixel is seen along the unit vector v of its camera; B holds two axes across v. The small difference of a direction
// u from v is, in pixels, J^-1 B' (u - v) with J = B' dv/dpixel. To first order that is the reprojection error, and it
// exists wherever the pixel has a ray: no division by depth, so wide and panoramic cameras are no special case.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "geometry/camera/camera.h"
#include "geometry/transform/pose.h"

namespace megablock {

struct RigRay {
  Eigen::Vector3d origin;                 // projection centre in the rig, metres
  Eigen::Vector3d direction;              // unit, rig axes
  Eigen::Matrix<double, 2, 3> to_pixels;  // of a difference of directions, rig axes
};

// Empty where the distortion cannot be inverted.
std::optional<RigRay> rig_ray(const Pose& mount, const Intrinsics& intrinsics, const Eigen::Vector2d& pixel);

// The ray as one of a larger rig, in which `inner` is the pose of the smaller one (larger -> smaller).
RigRay carried(const RigRay& ray, const Pose& inner);

struct RayResidual {
  Eigen::Vector2d pixels;                // predicted minus measured
  Eigen::Matrix<double, 2, 3> by_point;  // by the point's rig coordinates, px/m
};

// Residual of a point given in rig coordinates; empty when it does not lie in front (90 degrees or more off the ray).
std::optional<RayResidual> ray_residual(const RigRay& ray, const Eigen::Vector3d& in_rig);

// Derivative of a point's rig coordinates by the increment of the rig's pose (PoseIncrement): 3x6.
Eigen::Matrix<double, 3, 6> in_rig_by_pose(const Pose& rig, const Eigen::Vector3d& point);

}  // namespace megablock
