// Errors of matches and trusted relative orientations, against independent formulas and known trajectories.
#include "match/filter/match_errors.h"

#include <gtest/gtest.h>

#include "geometry/transform/rotation.h"
#include "geometry/two_view/relative_adjustment.h"
#include "match/verification/trusted_pair.h"

namespace megablock {
namespace {

const Intrinsics kCamera = {1000, 960, 540, 0, 0, 0, 0, 0};

// Two cameras with different attitudes; b is ahead and to the right of a.
struct TwoCameras {
  Pose a{rotation_exp<double>(Eigen::Vector3d(0.1, -0.2, 0.05)), {10, -4, 2}};
  Pose b{rotation_exp<double>(Eigen::Vector3d(0.05, 0.1, -0.1)), {11.5, -4.2, 2.8}};
  MatchErrors of(const Eigen::Vector2d& in_a, const Eigen::Vector2d& in_b) const {
    return match_errors(*ground_ray(a, kCamera, in_a), *ground_ray(b, kCamera, in_b), 1000, 1000);
  }
  // A point at the distance d, nearly straight ahead of a.
  Eigen::Vector3d ahead(double d) const { return a.centre + a.rotation.conjugate() * Eigen::Vector3d(0.1 * d, 0, d); }
  Eigen::Vector2d in_a(const Eigen::Vector3d& p) const { return project(kCamera, to_inside(a, p)); }
  Eigen::Vector2d in_b(const Eigen::Vector3d& p) const { return project(kCamera, to_inside(b, p)); }
};

TEST(MatchErrors, OfARightMatchTellWhereThePointIs) {
  const TwoCameras two;
  const Eigen::Vector3d point = two.ahead(12);
  const MatchErrors e = two.of(two.in_a(point), two.in_b(point));
  EXPECT_LT(e.reprojection_px, 1e-6);
  EXPECT_LT(e.ray_distance_m, 1e-8);
  EXPECT_NEAR(e.distance_a_m, (point - two.a.centre).norm(), 1e-6);
  EXPECT_NEAR(e.distance_b_m, (point - two.b.centre).norm(), 1e-6);
  const Eigen::Vector3d to_a = (two.a.centre - point).normalized(), to_b = (two.b.centre - point).normalized();
  EXPECT_NEAR(e.angle_rad, std::acos(to_a.dot(to_b)), 1e-9);
}

// The residual by an independent formula for pinhole cameras. It is exact to first order, so the error is small.
TEST(MatchErrors, ReprojectionIsSampsonsResidual) {
  const TwoCameras two;
  const Eigen::Vector3d point = two.ahead(9);
  const Eigen::Vector2d a = two.in_a(point), b = two.in_b(point) + Eigen::Vector2d(1.5, 2);
  RelativeOrientation pose;
  pose.rotation = two.b.rotation * two.a.rotation.conjugate();
  pose.base = (two.b.rotation * (two.a.centre - two.b.centre)).normalized();
  const double sampson =
      1000 * std::abs(sampson_residual(essential_from(pose), *unproject(kCamera, a), *unproject(kCamera, b)));
  const MatchErrors e = two.of(a, b);
  EXPECT_GT(sampson, 0.5);
  // Pixels of a plane image grow towards the border, angles do not; the difference is a few per cent here.
  EXPECT_NEAR(e.reprojection_px, sampson, 0.1 * sampson);
  EXPECT_GT(e.ray_distance_m, 1e-3);
}

TEST(MatchErrors, BehindTheCamerasIsNegative) {
  const TwoCameras two;
  // Rays that meet behind the cameras: both directions are turned around.
  const Eigen::Vector3d point = two.ahead(8);
  const Ray a{two.a.centre, (two.a.centre - point).normalized()}, b{two.b.centre, (two.b.centre - point).normalized()};
  const MatchErrors e = match_errors(a, b, 1000, 1000);
  EXPECT_NEAR(e.distance_a_m, -(point - two.a.centre).norm(), 1e-6);
  EXPECT_NEAR(e.distance_b_m, -(point - two.b.centre).norm(), 1e-6);
  EXPECT_LT(e.reprojection_px, 1e-6);
  // Parallel rays meet far away.
  const MatchErrors parallel = match_errors(a, {two.b.centre, a.direction}, 1000, 1000);
  EXPECT_GE(std::abs(parallel.distance_a_m), 1e4);
  EXPECT_TRUE(std::isfinite(parallel.reprojection_px));
}

// Frames with two cameras, 4 m and half a second apart. The trajectory as a whole is off by metres.
Block drive(std::int64_t frames) {
  Block block;
  Camera camera;
  camera.width = 1920;
  camera.height = 1080;
  camera.intrinsics = kCamera;
  block.cameras = {camera, camera};
  Rig rig;
  rig.mounts.push_back({CameraIndex(0), {}});
  rig.mounts.push_back(
      {CameraIndex(1), {rotation_exp<double>(Eigen::Vector3d(0, 0.8, 0)), {0.3, 0, 0.1}}, 0.01, 0.004});
  block.rigs.push_back(rig);
  for (FrameIndex f(0); f.value < frames; ++f.value) {
    Frame frame;
    frame.rig = RigIndex(0);
    frame.pass = 0;
    frame.time_s = 0.5 * static_cast<double>(f.value);
    frame.given_pose = Pose{rotation_exp<double>(Eigen::Vector3d(0.01, 0.02 * static_cast<double>(f.value), 0)),
                            {3 + 4 * static_cast<double>(f.value), 2, 1}};
    block.frames.push_back(frame);
    for (int m = 0; m < 2; ++m) block.add_image("", {f, m, 0});
  }
  return block;
}

TEST(TrustedPairs, RelatesImagesOfOneDrive) {
  const Block block = drive(60);
  const TrustedPairs trajectory(block, {});
  const auto pair = trajectory.relate(ImageIndex(2), ImageIndex(7));  // frames 1 and 3, mounts 0 and 1
  ASSERT_TRUE(pair);
  EXPECT_GT(pair->rotation_sigma_rad, 0.01);
  EXPECT_GT(pair->position_sigma_m, 0.05);
  // A ground point has the same coordinates in the second camera, whichever chain of poses leads there.
  const Eigen::Vector3d point(14, 5, 20);
  const Pose a = camera_pose(*block.frames[FrameIndex(1)].given_pose, block.rigs.front().mounts[0].pose);
  const Pose b = camera_pose(*block.frames[FrameIndex(3)].given_pose, block.rigs.front().mounts[1].pose);
  const Eigen::Vector3d in_pair = pair->a.centre + pair->a.rotation.conjugate() * to_inside(a, point);
  EXPECT_LT((to_inside(pair->b, in_pair) - to_inside(b, point)).norm(), 1e-9);
  const auto turned = trajectory.relate(ImageIndex(7), ImageIndex(2));
  ASSERT_TRUE(turned);
  EXPECT_EQ(turned->a.centre, pair->b.centre);
  // Within one mount, its sigma does not enter that of the pair.
  EXPECT_NEAR(trajectory.relate(ImageIndex(3), ImageIndex(7))->position_sigma_m, 0.05, 1e-12);
  EXPECT_TRUE(trajectory.relate(ImageIndex(4), ImageIndex(5)));  // of one frame
}

TEST(TrustedPairs, TrustsNothingElse) {
  Block block = drive(60);
  EXPECT_FALSE(TrustedPairs(block, {}).relate(ImageIndex(0), ImageIndex(100))) << "25 s apart";
  TrustOptions off;
  off.use_trajectory = false;
  EXPECT_FALSE(TrustedPairs(block, off).relate(ImageIndex(0), ImageIndex(2)));
  block.frames[FrameIndex(1)].pass = 1;
  EXPECT_FALSE(TrustedPairs(block, {}).relate(ImageIndex(0), ImageIndex(2))) << "another drive";
  block.frames[FrameIndex(3)].time_s = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(TrustedPairs(block, {}).relate(ImageIndex(4), ImageIndex(6))) << "unknown time";
  block.frames[FrameIndex(4)].given_pose.reset();
  EXPECT_FALSE(TrustedPairs(block, {}).relate(ImageIndex(8), ImageIndex(10))) << "no pose";
}

TEST(TrustedPairs, RelativePosesGoBeforeGivenOnes) {
  Block block = drive(6);
  for (FrameIndex f(0); f.value + 1 < 6; ++f.value) {
    const Pose &from = *block.frames[f].given_pose, &to = *block.frames[FrameIndex(f.value + 1)].given_pose;
    block.relative_poses.push_back(
        {f,
         FrameIndex(f.value + 1),
         {to.rotation * from.rotation.conjugate(), from.rotation * (to.centre - from.centre)},
         1e-4,
         0.005});
  }
  const auto by_chain = TrustedPairs(block, {}).relate(ImageIndex(0), ImageIndex(6));
  block.relative_poses.clear();
  const auto by_poses = TrustedPairs(block, {}).relate(ImageIndex(0), ImageIndex(6));
  ASSERT_TRUE(by_chain && by_poses);
  EXPECT_LT((by_chain->b.centre - by_poses->b.centre).norm(), 1e-9);
  EXPECT_LT(rotation_angle(by_chain->b.rotation, by_poses->b.rotation), 1e-9);
  EXPECT_NEAR(by_chain->position_sigma_m, 0.005 * std::sqrt(3.0), 1e-12);
}

}  // namespace
}  // namespace megablock
