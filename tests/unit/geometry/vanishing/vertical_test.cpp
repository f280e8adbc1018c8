// The vertical among vanishing points, levelling, roll and pitch, and the attitude from axes, with covariances against
// many trials.
#include "geometry/vanishing/vertical.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <limits>

#include "geometry/camera/camera.h"
#include "geometry/transform/rotation.h"
#include "tests/support/geometry/segment_scenes.h"

namespace megablock {
namespace {

using fixture::Held;

AxisDirection axis_with(const Eigen::Vector3d& direction, double sigma_deg = 0.02) {
  const double variance = std::pow(sigma_deg * kDegree, 2);
  return {direction, variance * (Eigen::Matrix3d::Identity() - direction * direction.transpose())};
}

VanishingPoint point_at(const Eigen::Vector3d& direction, std::size_t lines = 40) {
  VanishingPoint p;
  p.axis = axis_with(direction);
  p.lines.resize(lines);
  return p;
}

TEST(Vertical, IsSignedDownAndTheOneThatAllAreOrthogonalTo) {
  const Held held{0.1, 0.3};
  const std::vector<VanishingPoint> points{point_at(held.horizontal(0.2), 90), point_at(-held.vertical(), 20),
                                           point_at(held.horizontal(0.9)), point_at(held.horizontal(2.2))};
  const auto vertical = find_vertical(points);
  ASSERT_TRUE(vertical);
  EXPECT_EQ(vertical->point, 1);
  EXPECT_LT((vertical->down.direction - held.vertical()).norm(), 1e-12);
}

TEST(Vertical, AStreetStraightAheadIsNone) {
  // Of three perpendicular axes, only the way the camera was held tells which is vertical.
  for (const double pitch : {-0.5, 0.0, 0.6})
    for (const double roll : {-0.2, 0.05}) {
      const Held held{roll, pitch};
      const std::vector<VanishingPoint> points{point_at(held.horizontal(0.01), 200),
                                               point_at(held.horizontal(0.01 + 90 * kDegree)),
                                               point_at(held.vertical(), 8)};
      const auto vertical = find_vertical(points);
      ASSERT_TRUE(vertical);
      EXPECT_EQ(vertical->point, 2) << pitch << ' ' << roll;
    }
}

TEST(Vertical, OfLeaningWallsTheOneWithMostLines) {
  const Held held{0.1, 0.3};
  const std::vector<VanishingPoint> points{point_at(Held{0.08, 0.28}.vertical(), 12), point_at(held.vertical(), 50),
                                           point_at(held.horizontal(0.4), 60)};
  const auto vertical = find_vertical(points);
  ASSERT_TRUE(vertical);
  EXPECT_EQ(vertical->point, 1);
}

TEST(Vertical, NoneWithoutCandidates) {
  const Held held;
  EXPECT_FALSE(find_vertical({}));
  EXPECT_FALSE(find_vertical(std::vector{point_at(held.horizontal(0))}));
  EXPECT_FALSE(find_vertical(std::vector{point_at(held.horizontal(1.57))}));
  EXPECT_TRUE(find_vertical(std::vector{point_at(held.vertical())}));
  EXPECT_FALSE(
      find_vertical(std::vector{point_at(Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()))}));
  // Stairs: near enough to the expected vertical, but oblique to most of the others.
  const Eigen::Vector3d oblique = Held{0.5, 0}.vertical();
  EXPECT_FALSE(find_vertical(
      std::vector{point_at(oblique), point_at(held.horizontal(0.5 * EIGEN_PI)), point_at(held.horizontal(0.7))}));
}

TEST(Vertical, PriorOfASensor) {
  // A camera that looks straight down has no upright image.
  VerticalPrior prior;
  prior.down = Eigen::Vector3d(0.02, -0.03, 1).normalized();
  prior.roll_sigma = prior.pitch_sigma = 2 * kDegree;
  const std::vector<VanishingPoint> points{point_at(Eigen::Vector3d::UnitY(), 90),
                                           point_at(Eigen::Vector3d::UnitX(), 80),
                                           point_at(-Eigen::Vector3d::UnitZ(), 10)};
  const auto vertical = find_vertical(points, prior);
  ASSERT_TRUE(vertical);
  EXPECT_EQ(vertical->point, 2);
  EXPECT_GT(vertical->down.direction.z(), 0.99);
}

TEST(Vertical, ExifCodes) {
  // Row 0 of the stored pixels is displayed: 1 at the top, 3 at the bottom, 6 on the right, 8 on the left; 2, 4, 5, 7
  // are mirror images.
  const Eigen::Vector3d x = Eigen::Vector3d::UnitX(), y = Eigen::Vector3d::UnitY();
  const Eigen::Vector3d down[9] = {y, y, y, -y, -y, x, x, -x, -x};
  for (int code = 0; code < 9; ++code) EXPECT_EQ(down_of_exif_orientation(code), down[code]) << code;
  EXPECT_EQ(down_of_exif_orientation(77), y);
}

TEST(Vertical, RollAndPitch) {
  for (const double roll : {-1.4, 0.0, 0.3, 3.0})
    for (const double pitch : {-1.2, 0.0, 0.5}) {
      const auto down = [](double r, double p) {
        return Eigen::Vector3d(std::sin(r) * std::cos(p), std::cos(r) * std::cos(p), -std::sin(p));
      };
      Eigen::Matrix<double, 3, 2> root;  // square root of the covariance that roll and pitch with these sigmas give
      const double h = 1e-6, sigma_roll = 0.01, sigma_pitch = 0.02;
      root.col(0) = (down(roll + h, pitch) - down(roll - h, pitch)) / (2 * h) * sigma_roll;
      root.col(1) = (down(roll, pitch + h) - down(roll, pitch - h)) / (2 * h) * sigma_pitch;
      const RollPitch found = roll_pitch_of({down(roll, pitch), root * root.transpose()});
      EXPECT_NEAR(found.roll, roll, 1e-12);
      EXPECT_NEAR(found.pitch, pitch, 1e-12);
      EXPECT_NEAR(std::sqrt(found.covariance(0, 0)), sigma_roll, 1e-8);
      EXPECT_NEAR(std::sqrt(found.covariance(1, 1)), sigma_pitch, 1e-8);
      EXPECT_NEAR(found.covariance(0, 1), 0, 1e-9);
    }
}

TEST(Vertical, LevelledImageHasUprightVerticals) {
  const Held held{0.15, -0.4};
  const PerspectiveCentre camera{{1504, 1000}, 3000};
  const Eigen::Matrix3d h = rotation_homography(camera, levelling_rotation(held.vertical()));
  fixture::SegmentScene scene(2, 0);
  scene.add_family(held.vertical(), 20);
  for (const auto& ends : scene.segments) {
    const Eigen::Vector2d a = (h * ends[0].homogeneous()).hnormalized(), b = (h * ends[1].homogeneous()).hnormalized();
    EXPECT_NEAR(a.x(), b.x(), 1e-6);
  }
}

struct Town {
  Eigen::Quaterniond truth = Eigen::Quaterniond(0.6, 0.5, -0.4, 0.3).normalized();
  // Two or three axes, seen with different errors.
  std::vector<SeenAxis> seen(int count, std::mt19937_64& random) const {
    std::normal_distribution<double> normal(0, 1);
    const Eigen::Vector3d ground[3] = {-Eigen::Vector3d::UnitZ(), Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY()};
    const double sigmas[3] = {0.02, 0.3, 0.1};
    std::vector<SeenAxis> axes;
    for (int k = 0; k < count; ++k) {
      const Eigen::Vector3d exact = truth * ground[k];
      const double u = normal(random), v = normal(random), sigma = sigmas[k] * kDegree;
      const Eigen::Vector3d off = tangent_plane(exact) * Eigen::Vector2d(sigma * u, 2 * sigma * v);
      const Eigen::Vector3d direction = (exact + off).normalized();
      const Eigen::Matrix<double, 3, 2> root =
          tangent_plane(direction) * Eigen::Vector2d(sigma, 2 * sigma).asDiagonal();
      axes.push_back({ground[k], {direction, root * root.transpose()}});
    }
    return axes;
  }
};

TEST(AttitudeFromAxes, ErrorsAreThoseOfTheCovariance) {
  constexpr int kTrials = 2000;
  std::mt19937_64 random(5);
  const Town town;
  for (const int count : {2, 3}) {
    double normalised = 0;
    for (int trial = 0; trial < kTrials; ++trial) {
      const auto attitude = attitude_from_axes(town.seen(count, random));
      ASSERT_TRUE(attitude);
      EXPECT_EQ(attitude->redundancy, 2 * count - 3);
      const Eigen::Vector3d error = rotation_log<double>(town.truth.conjugate() * attitude->rotation_cw);
      normalised += error.dot(attitude->covariance.inverse() * error) / 3 / kTrials;
    }
    EXPECT_NEAR(normalised, 1, 0.06) << count;  // more than three times its scatter
    RecordProperty("normalised" + std::to_string(count), std::to_string(normalised));
  }
}

TEST(AttitudeFromAxes, RefusesBadInput) {
  std::mt19937_64 random(6);
  auto axes = Town().seen(3, random);
  EXPECT_FALSE(attitude_from_axes(std::span(axes).first(1)));
  EXPECT_FALSE(attitude_from_axes(std::vector(3, axes[0])));
  auto bad = axes;
  bad[1].seen.direction.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(attitude_from_axes(bad));
  bad = axes;
  bad[2].seen.covariance(1, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(attitude_from_axes(bad));
  bad = axes;
  bad[1].seen.covariance.setZero();
  EXPECT_FALSE(attitude_from_axes(bad)) << "one without errors";
  for (SeenAxis& axis : bad) axis.seen.covariance.setZero();
  EXPECT_FALSE(attitude_from_axes(bad)) << "none with errors";
}

}  // namespace
}  // namespace megablock
