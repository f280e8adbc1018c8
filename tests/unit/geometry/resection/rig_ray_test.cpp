// Residuals of rays against reprojection errors, and their derivatives against differences.
#include "geometry/resection/rig_ray.h"

#include <gtest/gtest.h>

namespace megablock {
namespace {

Intrinsics camera() {
  Intrinsics k{};
  k[kFocal] = 1400, k[kPrincipalX] = 960, k[kPrincipalY] = 540, k[kRadial1] = -0.05;
  return k;
}

TEST(RigRay, ResidualIsTheReprojectionErrorInPixels) {
  const Pose mount{rotation_exp<double>(Eigen::Vector3d(0.3, -0.5, 0.1)), Eigen::Vector3d(0.2, 0.1, -0.3)};
  const Eigen::Vector2d shift(1.5, -0.8);
  for (const auto& in_camera : {Eigen::Vector3d(1, 2, 10), Eigen::Vector3d(-6, 3, 9), Eigen::Vector3d(0, 0, 30)}) {
    const Eigen::Vector3d in_rig = mount.centre + mount.rotation.conjugate() * in_camera;
    const auto ray = rig_ray(mount, camera(), project(camera(), in_camera) - shift);
    ASSERT_TRUE(ray);
    const auto residual = ray_residual(*ray, in_rig);
    ASSERT_TRUE(residual);
    // The axes perpendicular to the ray may be rotated relative to the image, so only lengths are compared.
    EXPECT_NEAR(residual->pixels.norm(), shift.norm(), 0.005);
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d step = 1e-5 * Eigen::Vector3d::Unit(axis);
      const Eigen::Vector2d slope =
          (ray_residual(*ray, in_rig + step)->pixels - ray_residual(*ray, in_rig - step)->pixels) / 2e-5;
      EXPECT_LT((slope - residual->by_point.col(axis)).norm(), 1e-5 * slope.norm() + 1e-6);
    }
  }
}

TEST(RigRay, DerivativeByThePose) {
  const Pose rig{rotation_exp<double>(Eigen::Vector3d(1, 0.4, -0.7)), Eigen::Vector3d(100, 50, 3)};
  const Eigen::Vector3d point(110, 45, 8);
  for (int k = 0; k < 6; ++k) {
    const PoseIncrement step = 1e-6 * PoseIncrement::Unit(k);
    const Eigen::Vector3d slope =
        (to_inside(pose_update(rig, step), point) - to_inside(pose_update(rig, -step), point)) / 2e-6;
    EXPECT_LT((slope - in_rig_by_pose(rig, point).col(k)).norm(), 1e-6);
  }
}

TEST(RigRay, CarriedRayMeetsTheSamePoint) {
  const Pose mount{rotation_exp<double>(Eigen::Vector3d(0.3, -0.5, 0.1)), Eigen::Vector3d(0.2, 0.1, -0.3)};
  const Pose inner{rotation_exp<double>(Eigen::Vector3d(0.1, 0.9, 0.2)), Eigen::Vector3d(4, 0.1, -0.2)};
  const auto ray = rig_ray(mount, camera(), {1200, 300});
  const RigRay outer = carried(*ray, inner);
  const Eigen::Vector3d in_inner = ray->origin + 12 * ray->direction + Eigen::Vector3d(0.01, 0.02, 0.03);
  const Eigen::Vector3d in_outer = inner.centre + inner.rotation.conjugate() * in_inner;
  EXPECT_LT((ray_residual(outer, in_outer)->pixels - ray_residual(*ray, in_inner)->pixels).norm(), 1e-9);
}

TEST(RigRay, NothingBehind) {
  const auto ray = rig_ray(Pose{}, camera(), {960, 540});
  EXPECT_FALSE(ray_residual(*ray, Eigen::Vector3d(0, 0, -5)));
}

}  // namespace
}  // namespace megablock
