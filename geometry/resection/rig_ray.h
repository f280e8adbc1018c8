// Turns an observation into a ray of its rig, with residuals in pixels for every camera model.
//
// The pixel is seen along the unit vector v. B has two unit axes perpendicular to v as columns, and J = B' dv/dpixel is
// how fast the ray turns with the pixel. A direction u that differs a little from v then has the residual, in pixels,
//
//     J^-1 B' (u - v).
//
// To first order this is the reprojection error. It exists wherever the pixel has a ray, as it does not divide by
// depth; wide-angle and panoramic cameras are no special case.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "geometry/camera/camera.h"
#include "geometry/transform/pose.h"

namespace megablock {

struct RigRay {
  Eigen::Vector3d origin;                 // projection centre in the rig, metres
  Eigen::Vector3d direction;              // unit vector, rig axes
  Eigen::Matrix<double, 2, 3> to_pixels;  // J^-1 B' in rig axes: turns a difference of directions into pixels
};

// Returns the ray of a pixel of the camera with this mount. Empty where the distortion cannot be inverted.
std::optional<RigRay> rig_ray(const Pose& mount, const Intrinsics& intrinsics, const Eigen::Vector2d& pixel);

// The same ray in the axes of a larger rig; `inner` is the pose of the smaller rig in it (larger -> smaller).
RigRay carried(const RigRay& ray, const Pose& inner);

struct RayResidual {
  Eigen::Vector2d pixels;                // predicted minus measured
  Eigen::Matrix<double, 2, 3> by_point;  // derivative by the point's rig coordinates, px/m
};

// Returns the residual of a point in rig coordinates. Empty when the point is not in front: 90 degrees or more off the
// ray.
std::optional<RayResidual> ray_residual(const RigRay& ray, const Eigen::Vector3d& in_rig);

// Derivative of a point's rig coordinates by the increment of the rig's pose (PoseIncrement): -R [X - C]x, -R.
Eigen::Matrix<double, 3, 6> in_rig_by_pose(const Pose& rig, const Eigen::Vector3d& point);

}  // namespace megablock
