// Refraction and earth curvature: against the formulas of the textbooks for vertical images, against an integral
// through the standard atmosphere, and against a point on a sphere.
#include "geometry/camera/environment.h"

#include <gtest/gtest.h>

#include <cmath>

#include "geometry/camera/camera.h"
#include "geometry/numbers/angles.h"

namespace megablock {
namespace {

constexpr double kPrincipalDistance = 12000;

Intrinsics pinhole() {
  Intrinsics camera(CameraModel{CameraModelKind::kPinhole});
  camera[kFocal] = kPrincipalDistance;
  return camera;
}

// Outward shift of a pixel at the distance r from the centre of a vertical image.
double shift(const EnvironmentEffect& effect, double r) {
  const Eigen::Vector2d pixel(0.6 * r, -0.8 * r);
  const Eigen::Vector2d seen = seen_pixel(effect, pinhole(), pixel, Eigen::Vector3d::UnitZ());
  EXPECT_NEAR(seen.x() * pixel.y() - seen.y() * pixel.x(), 0, 1e-6 * r * r);  // radial
  return seen.norm() - r;
}

TEST(Environment, VerticalPhotographHasTheCorrectionsOfTheTextbooks) {
  const double p = kPrincipalDistance, height = 3000, ground = 200;
  const double refraction = refraction_constant(height, ground), curvature = curvature_constant(height - ground);
  for (const double r : {100., 3000., 9000.}) {
    EXPECT_NEAR(shift({refraction, 0}, r), refraction * (r + r * r * r / (p * p)), 1e-3);
    EXPECT_NEAR(shift({0, curvature}, r), -(height - ground) * r * r * r / (2 * 6.371e6 * p * p), 1e-3);
  }
  EXPECT_NEAR(shift({}, 5000), 0, 1e-9);
}

TEST(Environment, RefractionIsThatOfTheStandardAtmosphere) {
  // Refraction at the height z turns the tangent at the camera, against the chord, by the share (z - h) / (H - h) of
  // its own angle.
  const auto integrated = [](double camera, double ground) {
    double sum = 0;
    constexpr int kSteps = 10000;
    const double step = (camera - ground) / kSteps;
    for (int i = 0; i < kSteps; ++i) {
      const double z = ground + (i + 0.5) * step;
      const double slope = 2.77e-4 * 4.2559 * 2.25577e-5 * std::pow(1 - 2.25577e-5 * z, 3.2559);  // -dn/dz
      sum += (z - ground) / (camera - ground) * slope * step;
    }
    return sum;
  };
  for (const auto& [camera, ground] : {std::pair(1000., 0.), {3000., 0.}, {3000., 1000.}, {6000., 500.}, {9000., 0.}})
    EXPECT_NEAR(refraction_constant(camera, ground) / integrated(camera, ground), 1, 0.25) << camera << ' ' << ground;
}

TEST(Environment, RefractionOverGroundBelowTheSea) {
  EXPECT_NEAR(refraction_constant(0.5, -3000), 3.0e-5, 0.1e-5);
  EXPECT_EQ(refraction_constant(600, -400), refraction_constant(1000, 0));
  for (const double ground : {-3000., -400., -1e-3, 0., 1e-3, 0.5})
    for (const double height : {1e-6, 0.5, 100., 3000.}) {
      const double constant = refraction_constant(ground + height, ground);
      EXPECT_GE(constant, 0) << ground << ' ' << height;
      EXPECT_LE(constant, 2e-8 * height) << ground << ' ' << height;  // K < (H - h) (H + h) / H 1e-5 per kilometre
    }
}

TEST(Environment, RayToAPointOnTheCurvedEarth) {
  const double height = 2500;
  for (const double distance : {10., 1000., 5000.}) {
    const Eigen::Vector3d flat(distance, 0, -height),
        sunk(distance, 0, -height - distance * distance / (2 * kEarthRadiusM));
    const Eigen::Vector3d seen =
        seen_ray({0, curvature_constant(height)}, flat.normalized(), -Eigen::Vector3d::UnitZ());
    EXPECT_LT((seen - sunk.normalized()).norm(), 1e-14);
  }
}

TEST(Environment, InverseUndoesTheEffectAtEveryAngle) {
  for (const double scale : {0., 1., 3.}) {  // multiples of the effect of 9 km
    const EnvironmentEffect effect{scale * refraction_constant(9000, 0), scale * curvature_constant(9000)};
    for (double angle = 0; angle <= std::numbers::pi; angle += 0.01)
      EXPECT_NEAR(geometric_angle(effect, seen_angle(effect, angle)), angle, 1e-14) << angle;
    const Eigen::Vector3d down = Eigen::Vector3d(0.3, -0.1, -1).normalized();
    for (const Eigen::Vector3d& ray : {Eigen::Vector3d(0.3, -0.1, -1), Eigen::Vector3d(1, 1, -1),
                                       Eigen::Vector3d(0, 1, 0), Eigen::Vector3d(0, 0.2, 1)}) {
      const Eigen::Vector3d unit = ray.normalized();
      EXPECT_LT((geometric_ray(effect, seen_ray(effect, unit, down), down) - unit).norm(), 1e-14);
    }
  }
}

TEST(Environment, GoesOnSmoothlyToTheHorizonAndBeyond) {
  const EnvironmentEffect effect{refraction_constant(3000, 0), curvature_constant(3000)};
  const double limit = 80 * kDegree;
  EXPECT_NEAR(seen_angle(effect, limit + 1e-9), seen_angle(effect, limit - 1e-9), 3e-9);
  EXPECT_NEAR(seen_angle(effect, 120 * kDegree) - 120 * kDegree, seen_angle(effect, limit) - limit, 1e-14);
}

TEST(Environment, CameraBelowTheGroundOrWithoutARay) {
  EXPECT_EQ(refraction_constant(100, 200), 0);
  EXPECT_EQ(refraction_constant(std::nan(""), 0), 0);
  EXPECT_EQ(curvature_constant(-5), 0);
  const EnvironmentEffect effect{1e-5, 1e-4};
  EXPECT_TRUE(seen_pixel(effect, pinhole(), {std::nan(""), 0}, Eigen::Vector3d::UnitZ()).hasNaN());
}

}  // namespace
}  // namespace megablock
