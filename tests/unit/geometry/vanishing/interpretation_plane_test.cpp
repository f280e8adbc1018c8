// Lines, their feet and interpretation planes: exact cases, and covariances against differences.
#include "geometry/vanishing/interpretation_plane.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <limits>
#include <random>

#include "geometry/camera/camera.h"
#include "geometry/numbers/angles.h"
#include "geometry/vanishing/image_line.h"
#include "tests/support/geometry/segment_scenes.h"

namespace megablock {
namespace {

using Ends = std::array<Eigen::Vector2d, 2>;

ImageLine line_with(double theta, double rho) { return {theta, rho, Eigen::Matrix2d::Identity()}; }

TEST(ImageLine, IsExactOnExactPoints) {
  for (int degrees = -175; degrees <= 180; degrees += 5) {
    const double theta = degrees * kDegree;
    const Eigen::Vector2d along(std::cos(theta), std::sin(theta)), across(-along.y(), along.x());
    const auto line = fit_image_line(Ends{123.4 * across + 10 * along, 123.4 * across + 210 * along}, 0.3);
    ASSERT_TRUE(line);
    EXPECT_NEAR(std::abs(line->along().dot(along)), 1, 1e-12);
    EXPECT_LT((line->rho * line->across() - 123.4 * across).norm(), 1e-9);
    // For a segment of length L with end points of accuracy s, the direction has the sigma s sqrt(2) / L, and the
    // position in the middle the sigma s / sqrt(2).
    EXPECT_NEAR(std::sqrt(line->covariance(0, 0)), 0.3 * std::sqrt(2.0) / 200, 1e-9);
    const ImageLine middle = line_about(*line, 123.4 * across + 110 * along);
    EXPECT_NEAR(middle.rho, 0, 1e-9);
    EXPECT_NEAR(std::sqrt(middle.covariance(1, 1)), 0.3 / std::sqrt(2.0), 1e-9);
    EXPECT_NEAR(middle.covariance(0, 1), 0, 1e-9);
  }
}

TEST(ImageLine, FootAndMovedOriginByDifferences) {
  const double theta = 0.7, rho = -350, h = 1e-6;
  const Eigen::Vector2d origin(820, -95);
  Eigen::Matrix2d foot, moved;
  for (int k = 0; k < 2; ++k) {
    const ImageLine up = line_with(theta + (k == 0 ? h : 0), rho + (k == 1 ? h : 0));
    const ImageLine down = line_with(theta - (k == 0 ? h : 0), rho - (k == 1 ? h : 0));
    foot.col(k) = (foot_of(up).point - foot_of(down).point) / (2 * h);
    const ImageLine a = line_about(up, origin), b = line_about(down, origin);
    moved.col(k) << (a.theta - b.theta) / (2 * h), (a.rho - b.rho) / (2 * h);
  }
  const ImageLine line = line_with(theta, rho);
  EXPECT_LT((foot_of(line).covariance - foot * foot.transpose()).norm(), 1e-4);
  EXPECT_LT((line_about(line, origin).covariance - moved * moved.transpose()).norm(), 1e-2);
}

TEST(ImageLine, IndependentPointsCarryItsCovariance) {
  std::vector<Eigen::Vector2d> points;
  for (int i = 0; i < 120; ++i) points.emplace_back(900 + 0.8 * i, 200 - 0.6 * i);
  const auto line = fit_image_line(points, 0.4);
  ASSERT_TRUE(line);
  const LinePoints two = independent_points(*line);
  EXPECT_NEAR((two.first - two.second).norm(), 120 / std::sqrt(3.0), 0.1);
  const auto again = fit_image_line(Ends{two.first, two.second}, two.sigma_px);
  ASSERT_TRUE(again);
  EXPECT_NEAR(again->rho, line->rho, 1e-9);
  EXPECT_LT((again->covariance - line->covariance).norm(), 1e-9 * line->covariance.norm());
}

TEST(ImageLine, RefusesWhatHasNoDirection) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(fit_image_line({}, 0.3));
  EXPECT_FALSE(fit_image_line(std::vector<Eigen::Vector2d>{{3, 4}}, 0.3));
  EXPECT_FALSE(fit_image_line(Ends{Eigen::Vector2d(3, 4), Eigen::Vector2d(3, 4)}, 0.3));
  EXPECT_FALSE(fit_image_line(Ends{Eigen::Vector2d(3, nan), Eigen::Vector2d(5, 4)}, 0.3));
  EXPECT_FALSE(fit_image_line(Ends{Eigen::Vector2d(3, 1), Eigen::Vector2d(5, 4)}, 0));
  EXPECT_FALSE(fit_image_line(Ends{Eigen::Vector2d(3, 1), Eigen::Vector2d(5, 4)}, nan));
  EXPECT_FALSE(fit_image_line(std::vector<Eigen::Vector2d>{{0, 0}, {1, 0}, {1, 1}, {0, 1}}, 0.3)) << "a square";
}

TEST(InterpretationPlane, HoldsTheLineAndHasItsDerivatives) {
  const PerspectiveCentre from{{1504, 1000}, 3008};
  for (const double theta : {-1.2, 0.0, 0.4, 1.5707963267948966, 2.9})
    for (const double rho : {-2500.0, 0.0, 700.0, 4000.0}) {
      const ImageLine line = line_with(theta, rho);
      const InterpretationPlane plane = interpretation_plane(line, from);
      EXPECT_NEAR(plane.normal.norm(), 1, 1e-14);
      for (const double t : {-900.0, 0.0, 1300.0}) {
        const Eigen::Vector2d p = rho * line.across() + t * line.along() - from.centre;
        EXPECT_NEAR(plane.normal.dot(Eigen::Vector3d(p.x(), p.y(), from.distance).normalized()), 0, 1e-13);
      }
      Eigen::Matrix<double, 3, 2> j;
      const double h[2] = {1e-6, 1e-3};
      for (int k = 0; k < 2; ++k) {
        const ImageLine up = line_with(theta + (k == 0 ? h[0] : 0), rho + (k == 1 ? h[1] : 0));
        const ImageLine down = line_with(theta - (k == 0 ? h[0] : 0), rho - (k == 1 ? h[1] : 0));
        j.col(k) = (interpretation_plane(up, from).normal - interpretation_plane(down, from).normal) / (2 * h[k]);
      }
      EXPECT_LT((plane.covariance - j * j.transpose()).norm(), 1e-7 * plane.covariance.norm());
    }
}

TEST(InterpretationPlane, OfTwoRaysIsThatOfTheirLine) {
  const double sigma = 0.4;
  const PerspectiveCentre camera{{1504, 1000}, 3000};
  const Eigen::Vector2d a(300, 500), b(700, 420);
  const auto ray = [&](const Eigen::Vector2d& p) {
    const Eigen::Vector3d v(p.x() - 1504, p.y() - 1000, 3000);
    const Eigen::Matrix3d unit = (Eigen::Matrix3d::Identity() - v * v.transpose() / v.squaredNorm()) / v.norm();
    const Eigen::Matrix<double, 3, 2> j = unit.leftCols<2>() * sigma;
    return std::pair<Eigen::Vector3d, Eigen::Matrix3d>(v.normalized(), j * j.transpose());
  };
  const auto [ray_a, covariance_a] = ray(a);
  const auto [ray_b, covariance_b] = ray(b);
  const auto by_rays = interpretation_plane(ray_a, covariance_a, ray_b, covariance_b);
  const auto line = fit_image_line(Ends{a, b}, sigma);
  ASSERT_TRUE(by_rays && line);
  const InterpretationPlane by_line = interpretation_plane(*line, camera);
  EXPECT_NEAR(std::abs(by_rays->normal.dot(by_line.normal)), 1, 1e-12);
  EXPECT_LT((by_rays->covariance - by_line.covariance).norm(), 1e-9 * by_line.covariance.norm());
  EXPECT_FALSE(interpretation_plane(ray_a, covariance_a, ray_a, covariance_a));
  EXPECT_FALSE(
      interpretation_plane(ray_a, covariance_a, ray_a * std::numeric_limits<double>::quiet_NaN(), covariance_b));
}

TEST(InterpretationPlane, OfACamera) {
  const Intrinsics camera{3000, 1504, 1000};
  const auto line = fit_image_line(Ends{Eigen::Vector2d(300, 500), Eigen::Vector2d(700, 420)}, 0.4);
  ASSERT_TRUE(line);
  const auto plane = interpretation_plane(*line, camera);
  const InterpretationPlane pinhole = interpretation_plane(*line, PerspectiveCentre{{1504, 1000}, 3000});
  ASSERT_TRUE(plane);
  EXPECT_NEAR(std::abs(plane->normal.dot(pinhole.normal)), 1, 1e-12);
  EXPECT_LT((plane->covariance - pinhole.covariance).norm(), 1e-6 * pinhole.covariance.norm());
}

TEST(AxisDirection, FromAnotherCentreAndInTheImage) {
  const PerspectiveCentre any = perspective_centre(3008, 2000), camera{{1490, 1020}, 3350};
  EXPECT_EQ(any.distance, 3008);
  const Eigen::Vector3d true_axis = Eigen::Vector3d(0.3, 0.8, -0.2).normalized();
  fixture::SegmentScene scene(3, 0);
  scene.camera = camera;
  scene.add_family(true_axis, 40);
  scene.sigma_px = 0.3;
  const auto fit = fit_axis(scene.planes(any));
  const auto direct = fit_axis(scene.planes(camera));
  ASSERT_TRUE(fit && direct);
  const AxisDirection seen = seen_from(fit->axis, any, camera);
  EXPECT_LT(fixture::axis_error_deg(seen.direction, true_axis), 1e-9);
  EXPECT_LT((seen.covariance - direct->axis.covariance).norm(), 1e-6 * seen.covariance.norm())
      << "wherever planes start from, the estimate is the same";

  const auto point = image_of(fit->axis, any), other = image_of(direct->axis, camera);
  ASSERT_TRUE(point && other);
  const Eigen::Vector2d expected = camera.centre + camera.distance / true_axis.z() * true_axis.head<2>();
  EXPECT_LT((point->pixel - expected).norm(), 1e-6);
  EXPECT_LT((point->covariance - other->covariance).norm(), 1e-6 * other->covariance.norm());
  EXPECT_FALSE(image_of({Eigen::Vector3d::UnitX(), Eigen::Matrix3d::Identity()}, any)) << "at infinity";
}

}  // namespace
}  // namespace megablock
