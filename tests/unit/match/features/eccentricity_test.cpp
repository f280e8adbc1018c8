// The eccentricity of keypoints, against a closed form and against the extremum of the detector's response to a
// rendered patch.
#include "match/features/eccentricity.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "geometry/camera/camera.h"
#include "io/block/tracks.h"

namespace megablock {
namespace {

// Wide-angle cameras with 600 x 400 pixels.
const Intrinsics kPerspective{250, 300, 200, 0, 0, 0, 0, 0};
const Intrinsics kDistorted{250, 310, 190, -0.1, 0.02, 0, 1e-3, -2e-3};
const Intrinsics kPanorama(CameraModel{CameraModelKind::kEquirectangular, 0}, {600 / (2 * std::numbers::pi), 300, 200});

double kernel_variance(double diameter) { return diameter * diameter / 4 * (1 + std::cbrt(4.0)) / 2; }

TEST(Eccentricity, OfAPerspectiveImageInClosedForm) {
  const double diameter = 6, variance = kernel_variance(diameter);
  for (const Eigen::Vector2d& off : {Eigen::Vector2d(0, 0), Eigen::Vector2d(150, 0), Eigen::Vector2d(-90, 120)}) {
    const double angle = std::atan(off.norm() / 250);
    const Eigen::Vector2d outwards = off.norm() > 0 ? Eigen::Vector2d(off.normalized()) : off;
    const Eigen::Vector2d expected = 4.0 / 3 * variance * std::sin(angle) * std::cos(angle) / 250 * outwards;
    const Eigen::Vector2d found = eccentricity_px(kPerspective, Eigen::Vector2d(300, 200) + off, diameter);
    EXPECT_LT((found - expected).norm(), 1e-6 * variance) << off.transpose();
  }
}

TEST(Eccentricity, NoneWhereTheCameraHasNoRay) {
  Intrinsics folded = kPerspective;
  folded[kRadial1] = -1;
  EXPECT_EQ(eccentricity_px(folded, {599, 399}, 6), Eigen::Vector2d(0, 0));
}

// Gradient of the Laplacian of a Gaussian of variance t (without its constant factor).
Eigen::Vector2d laplacian_gradient(const Eigen::Vector2d& y, double t) {
  const double s = y.squaredNorm() / t;
  return y * (4 - s) * std::exp(-s / 2);
}
double laplacian(const Eigen::Vector2d& y, double t) {
  const double s = y.squaredNorm() / t;
  return -t * (2 - s) * std::exp(-s / 2);
}

// The extremum of the response to a patch that would look like the Laplacian itself if the camera mapped directions
// linearly. Gradient and second derivatives of the response are summed over the pixels of the distorted patch.
Eigen::Vector2d extremum(const Intrinsics& camera, const Eigen::Vector2d& pixel, double t) {
  const Eigen::Vector3d ray = *viewing_ray(camera, pixel);
  const Eigen::Matrix<double, 3, 2> tangent = tangent_plane(ray);
  const Eigen::Matrix2d to_image = project_with_jacobian(camera, ray).by_point * tangent;
  const auto warped = [&](const Eigen::Vector2d& y) {
    const Eigen::Vector3d there = *viewing_ray(camera, pixel + y);
    return laplacian(to_image * (tangent.transpose() * there / ray.dot(there)), t);
  };
  const double step = 0.25, reach = 6 * std::sqrt(t), h = 1e-3;
  Eigen::Vector2d gradient = Eigen::Vector2d::Zero();
  Eigen::Matrix2d second = Eigen::Matrix2d::Zero();
  for (double x = -reach; x <= reach; x += step)
    for (double y = -reach; y <= reach; y += step) {
      const Eigen::Vector2d place(x, y);
      const double grey = warped(place);
      gradient -= laplacian_gradient(place, t) * grey;  // d/dc of L(place - c)
      for (int k = 0; k < 2; ++k) {
        const Eigen::Vector2d shift = h * Eigen::Vector2d::Unit(k);
        second.col(k) += grey * (laplacian_gradient(place + shift, t) - laplacian_gradient(place - shift, t)) / (2 * h);
      }
    }
  return -second.inverse() * gradient;
}

TEST(Eccentricity, IsWhereTheDetectorsResponseIsGreatest) {
  const double diameter = 3;
  for (const Intrinsics& camera : {kPerspective, kDistorted, kPanorama})
    for (const Eigen::Vector2d& pixel : {Eigen::Vector2d(420, 210), Eigen::Vector2d(210, 300)}) {
      const Eigen::Vector2d expected = extremum(camera, pixel, kernel_variance(diameter));
      const Eigen::Vector2d found = eccentricity_px(camera, pixel, diameter);
      EXPECT_GT(expected.norm(), 1e-4);
      EXPECT_LT((found - expected).norm(), 0.03 * expected.norm()) << found.transpose() << ", " << expected.transpose();
    }
}

TEST(Eccentricity, IsTakenOffTheKeypoint) {
  const FixedPixel moved =
      without_eccentricity(kPerspective, Keypoint{to_fixed_pixel(450), to_fixed_pixel(200), 20, 0});
  const double shift = eccentricity_px(kPerspective, {450, 200}, 20).x();
  EXPECT_GT(shift, 0.1);
  EXPECT_NEAR(from_fixed_pixel(moved.x), 450 - shift, 1e-3);
  EXPECT_EQ(moved.y, to_fixed_pixel(200));
  const FixedPixel on_axis =
      without_eccentricity(kPerspective, Keypoint{to_fixed_pixel(300), to_fixed_pixel(200), 8, 0});
  EXPECT_EQ(on_axis.x, to_fixed_pixel(300));
}

}  // namespace
}  // namespace megablock
