#include "geometry/resection/rig_ray.h"

#include <Eigen/LU>

namespace megablock {

std::optional<RigRay> rig_ray(const Pose& mount, const Intrinsics& intrinsics, const Eigen::Vector2d& pixel) {
  const auto ray = viewing_ray(intrinsics, pixel);
  if (!ray) return std::nullopt;
  Eigen::Matrix<double, 3, 2> by_pixel;  // central differences over one pixel, exact to about 1e-7
  for (int axis = 0; axis < 2; ++axis) {
    const Eigen::Vector2d half = 0.5 * Eigen::Vector2d::Unit(axis);
    const auto before = viewing_ray(intrinsics, pixel - half), after = viewing_ray(intrinsics, pixel + half);
    if (!before || !after) return std::nullopt;
    by_pixel.col(axis) = *after - *before;
  }
  Eigen::Matrix<double, 3, 2> across;
  across.col(0) = ray->unitOrthogonal();
  across.col(1) = ray->cross(across.col(0));
  const Eigen::Matrix2d scale = across.transpose() * by_pixel;
  const Eigen::Matrix3d to_camera = mount.rotation.toRotationMatrix();
  RigRay result{mount.centre, to_camera.transpose() * *ray, scale.inverse() * across.transpose() * to_camera};
  if (!result.to_pixels.allFinite()) return std::nullopt;
  return result;
}

RigRay carried(const RigRay& ray, const Pose& inner) {
  const Eigen::Matrix3d to_inner = inner.rotation.toRotationMatrix();
  return {inner.centre + to_inner.transpose() * ray.origin, to_inner.transpose() * ray.direction,
          ray.to_pixels * to_inner};
}

// The limit of the cosine keeps the derivative bounded near 90 degrees.
std::optional<RayResidual> ray_residual(const RigRay& ray, const Eigen::Vector3d& in_rig) {
  const Eigen::Vector3d sight = in_rig - ray.origin;
  const double distance = sight.norm();
  if (!(sight.dot(ray.direction) > 1e-9 * distance)) return std::nullopt;
  const Eigen::Vector3d unit = sight / distance;
  const Eigen::Matrix3d by_sight = (Eigen::Matrix3d::Identity() - unit * unit.transpose()) / distance;
  return RayResidual{ray.to_pixels * (unit - ray.direction), ray.to_pixels * by_sight};
}

Eigen::Matrix<double, 3, 6> in_rig_by_pose(const Pose& rig, const Eigen::Vector3d& point) {
  const Eigen::Matrix3d rotation = rig.rotation.toRotationMatrix();
  Eigen::Matrix<double, 3, 6> jacobian;
  jacobian << -rotation * skew<double>(point - rig.centre), -rotation;
  return jacobian;
}

}  // namespace megablock
