// Rotations: exponential and logarithm against Rodrigues' formula, derivatives against differences, and photogrammetric
// angles against known attitudes.
#include "geometry/transform/rotation.h"

#include <gtest/gtest.h>

#include <numbers>
#include <random>

#include "geometry/transform/pose.h"

namespace megablock {
namespace {

constexpr double kPi = std::numbers::pi;

Eigen::Vector3d random_vector(std::mt19937_64& random, double scale) {
  std::normal_distribution<double> normal(0, scale);
  return {normal(random), normal(random), normal(random)};
}

Eigen::Quaterniond rotation_of_rows(const Eigen::Vector3d& x, const Eigen::Vector3d& y, const Eigen::Vector3d& z) {
  Eigen::Matrix3d m;
  m << x.transpose(), y.transpose(), z.transpose();
  return Eigen::Quaterniond(m);
}

TEST(Rotation, ExpIsRodrigues) {
  std::mt19937_64 random(1);
  for (double scale : {1e-9, 1e-5, 1e-2, 1.0, 3.0}) {
    const Eigen::Vector3d w = random_vector(random, scale);
    const Eigen::Matrix3d expected = Eigen::AngleAxisd(w.norm(), w.normalized()).toRotationMatrix();
    EXPECT_LT((rotation_exp<double>(w).toRotationMatrix() - expected).norm(), 1e-14) << scale;
  }
  EXPECT_EQ(rotation_exp<double>(Eigen::Vector3d::Zero()).w(), 1);
}

TEST(Rotation, LogInvertsExpUpToHalfATurn) {
  std::mt19937_64 random(2);
  for (double angle : {0.0, 1e-12, 1e-8, 1e-4, 0.5, 2.0, kPi - 1e-6, kPi - 1e-9}) {
    const Eigen::Vector3d w = angle * random_vector(random, 1).normalized();
    const Eigen::Quaterniond q = rotation_exp<double>(w);
    EXPECT_LT((rotation_log<double>(q) - w).norm(), 1e-13 + 1e-15 * angle) << angle;
    EXPECT_LT((rotation_log<double>(Eigen::Quaterniond(-q.coeffs())) - w).norm(), 1e-13) << "other sign";
  }
}

TEST(Rotation, UpdateTurnsTheWorldAxes) {
  std::mt19937_64 random(3);
  const Eigen::Quaterniond r = rotation_exp<double>(random_vector(random, 1));
  const Eigen::Vector3d x = random_vector(random, 10), w = random_vector(random, 1e-6);
  const Eigen::Vector3d expected = r * x - r * x.cross(w);  // d(R X)/dw = -R [X]x
  EXPECT_LT((rotation_update(r, w) * x - expected).norm(), 1e-10);
  const Eigen::Vector3d large = random_vector(random, 1);
  EXPECT_LT(rotation_angle(rotation_update(r, large), r * rotation_exp<double>(large)), 1e-14);
  EXPECT_NEAR(rotation_update(r, large).norm(), 1, 1e-15);
}

TEST(Rotation, InverseRightJacobianMatchesFiniteDifferences) {
  std::mt19937_64 random(4);
  for (double angle : {0.0, 1e-5, 5e-4, 2e-3, 0.3, 1.5, 3.0}) {
    const Eigen::Vector3d w = angle * random_vector(random, 1).normalized();
    Eigen::Matrix3d numeric;
    constexpr double kStep = 1e-5;
    for (int i = 0; i < 3; ++i) {
      const Eigen::Vector3d d = kStep * Eigen::Vector3d::Unit(i);
      numeric.col(i) = (rotation_log<double>(rotation_exp<double>(w) * rotation_exp<double>(d)) -
                        rotation_log<double>(rotation_exp<double>(w) * rotation_exp<double>(-d))) /
                       (2 * kStep);
    }
    EXPECT_LT((right_jacobian_inverse(w) - numeric).norm(), 1e-8) << angle;
  }
}

TEST(Rotation, AngleBetweenAttitudes) {
  std::mt19937_64 random(5);
  const Eigen::Quaterniond a = rotation_exp<double>(random_vector(random, 1));
  for (double angle : {0.0, 1e-9, 0.1, 3.1}) {
    const Eigen::Quaterniond b = a * rotation_exp<double>(angle * random_vector(random, 1).normalized());
    EXPECT_NEAR(rotation_angle(a, b), angle, 1e-14);
    EXPECT_NEAR(rotation_angle(b, a), angle, 1e-14);
  }
}

const Eigen::Vector3d kEast(1, 0, 0), kNorth(0, 1, 0), kUp(0, 0, 1);

TEST(Attitude, NadirWithTheImageTopToTheNorth) {
  const Eigen::Quaterniond nadir = rotation_of_rows(kEast, -kNorth, -kUp);
  const OmegaPhiKappa opk = omega_phi_kappa(nadir);
  EXPECT_NEAR(opk.omega, 0, 1e-15);
  EXPECT_NEAR(opk.phi, 0, 1e-15);
  EXPECT_NEAR(opk.kappa, 0, 1e-15);
  EXPECT_NEAR(yaw_pitch_roll(nadir).pitch, -kPi / 2, 1e-7);
  EXPECT_LT(rotation_angle(rotation_from(YawPitchRoll{0, -kPi / 2, 0}), nadir), 1e-14);
}

TEST(Attitude, HorizonLookingNorthAndEast) {
  EXPECT_LT(rotation_angle(rotation_from(YawPitchRoll{0, 0, 0}), rotation_of_rows(kEast, -kUp, kNorth)), 1e-14);
  const Eigen::Quaterniond east = rotation_of_rows(-kNorth, -kUp, kEast);
  const YawPitchRoll ypr = yaw_pitch_roll(east);
  EXPECT_NEAR(ypr.yaw, kPi / 2, 1e-15);
  EXPECT_NEAR(ypr.pitch, 0, 1e-15);
  EXPECT_NEAR(ypr.roll, 0, 1e-15);
  EXPECT_LT(rotation_angle(rotation_from(YawPitchRoll{kPi / 2, 0, 0}), east), 1e-14);
}

TEST(Attitude, SignsOfTheAngles) {
  // Pitch up: the viewing direction rises. Roll right wing down: the image's right side points down.
  EXPECT_GT((rotation_from(YawPitchRoll{0.3, 0.2, 0}).conjugate() * Eigen::Vector3d::UnitZ()).z(), 0.1);
  EXPECT_LT((rotation_from(YawPitchRoll{0.3, 0, 0.2}).conjugate() * Eigen::Vector3d::UnitX()).z(), -0.1);
  // Kappa turns the image counter-clockwise as seen from above: its x axis turns from east towards north.
  EXPECT_GT((rotation_from(OmegaPhiKappa{0, 0, 0.2}).conjugate() * Eigen::Vector3d::UnitX()).dot(kNorth), 0.1);
  // Omega tilts the view towards the north, phi towards the west (the view is along the image's -z).
  EXPECT_GT((rotation_from(OmegaPhiKappa{0.2, 0, 0}).conjugate() * Eigen::Vector3d::UnitZ()).dot(kNorth), 0.1);
  EXPECT_LT((rotation_from(OmegaPhiKappa{0, 0.2, 0}).conjugate() * Eigen::Vector3d::UnitZ()).dot(kEast), -0.1);
}

TEST(Attitude, RoundTrips) {
  std::mt19937_64 random(6);
  std::uniform_real_distribution<double> full(-kPi, kPi), half(-1.5, 1.5);
  for (int i = 0; i < 100; ++i) {
    const OmegaPhiKappa opk{full(random), half(random), full(random)};
    const OmegaPhiKappa back = omega_phi_kappa(rotation_from(opk));
    EXPECT_NEAR(back.omega, opk.omega, 1e-12);
    EXPECT_NEAR(back.phi, opk.phi, 1e-12);
    EXPECT_NEAR(back.kappa, opk.kappa, 1e-12);
    const YawPitchRoll ypr{full(random), half(random), full(random)};
    const YawPitchRoll again = yaw_pitch_roll(rotation_from(ypr));
    EXPECT_NEAR(again.yaw, ypr.yaw, 1e-12);
    EXPECT_NEAR(again.pitch, ypr.pitch, 1e-12);
    EXPECT_NEAR(again.roll, ypr.roll, 1e-12);
    const Eigen::Quaterniond any = rotation_exp<double>(random_vector(random, 2));
    EXPECT_LT(rotation_angle(rotation_from(omega_phi_kappa(any)), any), 1e-12);
    EXPECT_LT(rotation_angle(rotation_from(yaw_pitch_roll(any)), any), 1e-12);
  }
}

TEST(Pose, ChainThroughTheMountIsOneCameraPose) {
  std::mt19937_64 random(7);
  const Pose frame{rotation_exp<double>(random_vector(random, 1)), Eigen::Vector3d(5e5, -3e5, 200)};
  const Pose mount{rotation_exp<double>(random_vector(random, 1)), random_vector(random, 1)};
  const Eigen::Vector3d point = frame.centre + random_vector(random, 30);
  const Eigen::Vector3d expected = mount.rotation * (frame.rotation * (point - frame.centre) - mount.centre);
  EXPECT_LT((to_camera(frame, mount, point) - expected).norm(), 1e-13);
  EXPECT_LT((to_inside(camera_pose(frame, mount), point) - expected).norm(), 1e-9);
}

}  // namespace
}  // namespace megablock
