// Yaw, pitch and roll of the aircraft: known attitudes, signs of the angles, and round trips.
#include "geometry/transform/body_attitude.h"

#include <gtest/gtest.h>

#include <numbers>
#include <random>

#include "geometry/transform/rotation.h"

namespace megablock {
namespace {

const Eigen::Vector3d kEastward(1, 0, 0), kNorthward(0, 1, 0), kUpward(0, 0, 1);

// World -> camera, from the camera axes in the world.
Eigen::Quaterniond rotation_of(const Eigen::Vector3d& right, const Eigen::Vector3d& down, const Eigen::Vector3d& view) {
  Eigen::Matrix3d r;
  r << right.transpose(), down.transpose(), view.transpose();
  return Eigen::Quaterniond(r);
}

TEST(BodyAttitude, NadirIsLevelAndItsTopGivesTheYaw) {
  const BodyAttitude north = body_attitude(rotation_of(kEastward, -kNorthward, -kUpward));
  EXPECT_NEAR(north.yaw, 0, 1e-15);
  EXPECT_NEAR(north.pitch, 0, 1e-15);
  EXPECT_NEAR(north.roll, 0, 1e-15);
  const BodyAttitude east = body_attitude(rotation_of(-kNorthward, -kEastward, -kUpward));  // top to the east
  EXPECT_NEAR(east.yaw, std::numbers::pi / 2, 1e-15);
  EXPECT_NEAR(east.pitch, 0, 1e-15);
  EXPECT_NEAR(east.roll, 0, 1e-15);
}

TEST(BodyAttitude, SignsOfTheAngles) {
  const auto view = [](const BodyAttitude& a) {
    return Eigen::Vector3d(rotation_from(a).conjugate() * Eigen::Vector3d::UnitZ());
  };
  // Flying north: nose up looks ahead, the right wing down looks to the left.
  EXPECT_NEAR(view({0, 0.2, 0}).dot(kNorthward), std::sin(0.2), 1e-15);
  EXPECT_NEAR(view({0, 0, 0.2}).dot(kEastward), -std::sin(0.2), 1e-15);
  // An oblique image 30 degrees off nadir to the east, the image's top ahead: pitch 30, yaw 90.
  const BodyAttitude oblique = body_attitude(
      rotation_of(-kNorthward, -(kEastward * std::cos(std::numbers::pi / 6) + kUpward * std::sin(std::numbers::pi / 6)),
                  kEastward * std::sin(std::numbers::pi / 6) - kUpward * std::cos(std::numbers::pi / 6)));
  EXPECT_NEAR(oblique.yaw, std::numbers::pi / 2, 1e-14);
  EXPECT_NEAR(oblique.pitch, std::numbers::pi / 6, 1e-14);
  EXPECT_NEAR(oblique.roll, 0, 1e-14);
}

TEST(BodyAttitude, GimbalOfADroneIsNinetyDegreesBelow) {
  for (const double yaw : {-2.0, 0.3, 1.7})
    for (const double pitch : {-0.4, 0.0, 0.5})
      EXPECT_LT(rotation_angle(rotation_from(BodyAttitude{yaw, pitch, 0}),
                               rotation_from(YawPitchRoll{yaw, pitch - std::numbers::pi / 2, 0})),
                1e-14);
}

TEST(BodyAttitude, RoundTrips) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> full(-std::numbers::pi, std::numbers::pi), half(-1.5, 1.5);
  for (int i = 0; i < 100; ++i) {
    const BodyAttitude a{full(random), half(random), full(random)}, b = body_attitude(rotation_from(a));
    EXPECT_NEAR(b.yaw, a.yaw, 1e-12);
    EXPECT_NEAR(b.pitch, a.pitch, 1e-12);
    EXPECT_NEAR(b.roll, a.roll, 1e-12);
  }
}

}  // namespace
}  // namespace megablock
