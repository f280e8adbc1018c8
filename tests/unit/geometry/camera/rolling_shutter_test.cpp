#include "geometry/camera/rolling_shutter.h"

#include <gtest/gtest.h>

#include "geometry/camera/camera.h"

namespace megablock {
namespace {

struct MovingCamera {
  Intrinsics camera = start_intrinsics(CameraModel(), 1000, 1500, 1000);
  Pose frame{rotation_exp<double>(Eigen::Vector3d(0.1, -0.2, 0.3)), {3, -2, 5}};
  Pose mount{rotation_exp<double>(Eigen::Vector3d(0.02, 0.5, -0.01)), {0.3, 0.1, -0.2}};
  Motion motion{{8, -3, 1}, {0.02, -0.1, 0.4}};
  MovingView view() const { return {camera, frame, mount, motion, {0.04, 1000}}; }

  // The pixel that a camera at the pose of time t sees, by matrices alone.
  Eigen::Vector2d seen_at(double t, const Eigen::Vector3d& point) const {
    const Eigen::Matrix3d turned =
        Eigen::AngleAxisd(t * motion.turn.norm(), motion.turn.normalized()).toRotationMatrix();
    // The axes of the frame, in ground axes, turn about the angular velocity.
    const Eigen::Matrix3d axes = turned * frame.rotation.toRotationMatrix().transpose();
    const Eigen::Vector3d in_rig = axes.transpose() * (point - (frame.centre + t * motion.velocity));
    const Eigen::Vector3d in_camera = mount.rotation.toRotationMatrix() * (in_rig - mount.centre);
    return {1000 * in_camera.x() / in_camera.z() + 750, 1000 * in_camera.y() / in_camera.z() + 500};
  }
  Eigen::Vector3d point_at(double x, double y, double depth) const {
    const Pose pose = camera_pose(frame, mount);
    return pose.centre + pose.rotation.conjugate() * Eigen::Vector3d(depth * x, depth * y, depth);
  }
};

TEST(RollingShutter, SeesAPointFromWhereItReadsItsRow) {
  const MovingCamera moving;
  for (const double y : {-0.45, -0.1, 0.0, 0.3, 0.45}) {
    const Eigen::Vector3d point = moving.point_at(0.2, y, 12);
    const Eigen::Vector2d pixel = moving_pixel(moving.view(), point);
    const double t = (pixel.y() / 1000 - 0.5) * 0.04;
    EXPECT_LT((pixel - moving.seen_at(t, point)).norm(), 1e-6) << y;
  }
}

TEST(RollingShutter, IsTakenOutWithTheDistanceOfThePoint) {
  const MovingCamera moving;
  for (const double y : {-0.45, -0.1, 0.3, 0.45}) {
    const Eigen::Vector3d point = moving.point_at(-0.3, y, 9);
    const Eigen::Vector2d pixel = moving_pixel(moving.view(), point), still = moving.seen_at(0, point);
    const Pose then = camera_pose(moved(moving.frame, moving.motion, (pixel.y() / 1000 - 0.5) * 0.04), moving.mount);
    const double distance = (point - then.centre).norm();
    EXPECT_LT((rolling_shift(moving.view(), point) - (pixel - still)).norm(), 1e-6) << y;
    EXPECT_LT((still_pixel(moving.view(), pixel, distance) - still).norm(), 1e-6) << y;
    EXPECT_GT((pixel - still).norm(), y * y * 20) << y;  // what there is to take out
    // An error of a hundredth of the distance is one of about a hundredth of the correction.
    EXPECT_LT((still_pixel(moving.view(), pixel, 1.01 * distance) - still).norm(),
              0.02 * (pixel - still).norm() + 1e-6);
  }
}

TEST(RollingShutter, ReadsFromTheLastRowWithANegativeTime) {
  EXPECT_DOUBLE_EQ((Readout{0.04, 1000}.time_of_row(0)), -0.02);
  EXPECT_DOUBLE_EQ((Readout{-0.04, 1000}.time_of_row(0)), 0.02);
}

TEST(RollingShutter, HasNoPixelBehindTheCamera) {
  const MovingCamera moving;
  EXPECT_FALSE(moving_pixel(moving.view(), moving.point_at(0, 0, -5)).allFinite());
}

}  // namespace
}  // namespace megablock
