// Acceptance tests of lines, vanishing points and the vertical (rows M13 to M36, M44), named after their ids.
#include <fmt/core.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <chrono>
#include <limits>

#include "geometry/camera/camera.h"
#include "geometry/estimation/gauss_helmert.h"
#include "geometry/transform/rotation.h"
#include "geometry/vanishing/vanishing_circles.h"
#include "geometry/vanishing/vanishing_votes.h"
#include "geometry/vanishing/vertical.h"
#include "reached.h"
#include "tests/support/geometry/segment_scenes.h"

namespace megablock {
namespace {

using fixture::axis_error_deg;
using fixture::Held;
using fixture::SegmentScene;
using fixture::urban_scene;

constexpr double kHeights[] = {0, -100, -1000, -3000, -1e4, -1e5, -1e6};
constexpr double kNoises[] = {0.2, 1.0};

// X10: 100 segments of about 200 px that meet at (1504, y).
SegmentScene bundle(double y, double sigma_px, std::uint64_t seed) {
  SegmentScene scene(seed, sigma_px);
  scene.add_family(Eigen::Vector3d(0, y - scene.camera.centre.y(), scene.camera.distance), 100, 150, 250);
  return scene;
}

TEST(Spec, AT18LineCovariance) {
  constexpr int kTrials = 40000, kPoints = 40;
  constexpr double kSigma = 0.3;
  std::mt19937_64 random(18);
  std::normal_distribution<double> normal(0, kSigma);
  for (const double theta : {0.3, 1.2}) {
    const Eigen::Vector2d along(std::cos(theta), std::sin(theta)), middle(420, -310);
    Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero(), predicted = Eigen::Matrix2d::Zero();
    for (int trial = 0; trial < kTrials; ++trial) {
      std::vector<Eigen::Vector2d> points;
      for (int i = 0; i < kPoints; ++i) {
        const double x = normal(random), y = normal(random);
        points.push_back(middle + 5.0 * (i - 0.5 * (kPoints - 1)) * along + Eigen::Vector2d(x, y));
      }
      const auto line = fit_image_line(points, kSigma);
      ASSERT_TRUE(line);
      const Eigen::Vector2d error(line->theta - theta, line->rho - (-middle.x() * along.y() + middle.y() * along.x()));
      scatter += error * error.transpose() / kTrials;
      predicted += line->covariance / kTrials;
    }
    const std::string at = fmt::format("direction {} rad, empirical over predicted ", theta);
    expect_within(scatter(0, 0) / predicted(0, 0), 1, 0.05, at + "variance of the direction");
    expect_within(scatter(0, 1) / predicted(0, 1), 1, 0.05, at + "covariance");
    expect_within(scatter(1, 1) / predicted(1, 1), 1, 0.05, at + "variance of the distance");
  }
}

// Of a vanishing point about this origin, as a direction with the covariance of the pixel: e' S^-1 e.
double normalised_error(const ImagePoint& point, const Eigen::Vector2d& origin, const SegmentScene& scene) {
  Eigen::Vector3d ray;
  ray << point.pixel + origin - scene.camera.centre, scene.camera.distance;
  const Eigen::Matrix<double, 3, 2> tangent = tangent_plane(Eigen::Vector3d(ray.normalized()));
  const double sign = ray.dot(scene.axes[0]) < 0 ? -1 : 1;
  const Eigen::Vector2d error = tangent.transpose() * scene.axes[0] * sign;
  const Eigen::Matrix2d by_pixel = tangent.topRows<2>().transpose() / ray.norm();
  return error.dot(propagated(by_pixel, point.covariance).inverse() * error);
}

TEST(Spec, AT19CovarianceOfVanishingPoints) {
  constexpr int kTrials = 1000;
  for (const double sigma : kNoises)
    for (const double y : kHeights) {
      double planes = 0, circles = 0;
      for (int trial = 0; trial < kTrials; ++trial) {
        const SegmentScene scene = bundle(y, sigma, static_cast<std::uint64_t>(trial) + 1);
        const auto fit = fit_axis(scene.planes(perspective_centre(scene.width, scene.height)));
        ASSERT_TRUE(fit);
        const AxisDirection axis = seen_from(fit->axis, perspective_centre(scene.width, scene.height), scene.camera);
        const Eigen::Matrix<double, 3, 2> tangent = tangent_plane(axis.direction);
        const double sign = axis.direction.dot(scene.axes[0]) < 0 ? -1 : 1;
        const Eigen::Vector2d error = tangent.transpose() * scene.axes[0] * sign;
        planes += error.dot((tangent.transpose() * axis.covariance * tangent).inverse() * error) / 2 / kTrials;

        std::vector<ImageLine> lines = scene.lines();
        const Eigen::Vector2d origin(-300, -200);
        for (ImageLine& line : lines) line = line_about(line, origin);
        const auto point = fit_vanishing_circle(lines);
        ASSERT_TRUE(point) << sigma << ' ' << y;
        circles += normalised_error(*point, origin, scene) / 2 / kTrials;
      }
      for (const auto& [name, mean] : {std::pair{"planes", planes}, std::pair{"circles", circles}}) {
        const std::string what = fmt::format("{}, {} px, y {}, mean normalised error", name, sigma, y);
        expect_at_least(mean, 0.8, what);
        expect_at_most(mean, 1.25, what);
      }
    }
}

double circle_error_deg(const SegmentScene& scene) {
  std::vector<ImageLine> lines = scene.lines();
  const Eigen::Vector2d origin(-300, -200);
  for (ImageLine& line : lines) line = line_about(line, origin);
  const auto point = fit_vanishing_circle(lines);
  if (!point) return 90;
  const Eigen::Vector2d off = point->pixel + origin - scene.camera.centre;
  return axis_error_deg(Eigen::Vector3d(off.x(), off.y(), scene.camera.distance).normalized(), scene.axes[0]);
}

TEST(Spec, AT20DistanceOfTheVanishingPoint) {
  constexpr int kTrials = 200;
  for (const double y : kHeights) {
    double mean[2] = {0, 0};
    for (int n = 0; n < 2; ++n) {
      double circles = 0, votes = 0;
      for (int trial = 0; trial < kTrials; ++trial) {
        const SegmentScene scene = bundle(y, kNoises[n], static_cast<std::uint64_t>(trial) + 1);
        const PerspectiveCentre from = perspective_centre(scene.width, scene.height);
        const auto fit = fit_axis(scene.planes(from));
        ASSERT_TRUE(fit);
        mean[n] += axis_error_deg(seen_from(fit->axis, from, scene.camera).direction, scene.axes[0]) / kTrials;
        circles += circle_error_deg(scene) / kTrials;
        votes += axis_error_deg(vanishing_point_by_votes(scene.planes()).value(), scene.axes[0]) / kTrials;
      }
      constexpr double kMostDeg[] = {0.04, 0.2};
      const std::string at = fmt::format("{} px, y {}, mean error, deg: ", kNoises[n], y);
      expect_at_most(mean[n], kMostDeg[n], at + "planes");
      expect_at_most(circles, 1.1 * mean[n], at + "circles, the same estimator as planes");
      expect_at_least(votes, mean[n], at + "intersections, against planes");
    }
    expect_within(mean[1] / mean[0], 5.25, 1.25, fmt::format("y {}, planes, error at 1 px over that at 0.2 px", y));

    SegmentScene exact(7, 0);
    exact.add_family(Eigen::Vector3d(0, y - 1000, 3000), 100, 150, 250);
    exact.sigma_px = 0.2;
    const auto fit = fit_axis(exact.planes());
    ASSERT_TRUE(fit);
    expect_at_most(axis_error_deg(fit->axis.direction, exact.axes[0]), 1e-9,
                   fmt::format("y {}, planes, error without noise, deg", y));
  }
}

struct Detection {
  int images = 0, verticals = 0, horizontals = 0, all_horizontals = 0, images_with_spurious = 0;
  double seconds = 0;

  // By the angles of what was found from each axis, degrees.
  void count(const std::vector<Eigen::Vector3d>& found, const std::vector<Eigen::Vector3d>& axes) {
    bool spurious = false;
    for (const Eigen::Vector3d& f : found)
      spurious = spurious || std::none_of(axes.begin(), axes.end(),
                                          [&](const Eigen::Vector3d& axis) { return axis_error_deg(f, axis) < 1; });
    ++images;
    images_with_spurious += spurious;
    for (std::size_t a = 0; a < axes.size(); ++a)
      (a == 0 ? verticals : horizontals) += std::any_of(
          found.begin(), found.end(), [&](const Eigen::Vector3d& f) { return axis_error_deg(f, axes[a]) < 0.5; });
    all_horizontals += static_cast<int>(axes.size()) - 1;
  }
  // Limits: shares of the verticals, of the horizontals, of the images with a wrong one.
  void expect(const std::string& name, double least_verticals, double least_horizontals, double most_spurious) const {
    const std::string of = fmt::format(" of {}", images);
    expect_at_least(verticals, least_verticals * images, name + "verticals found" + of);
    expect_at_least(horizontals, least_horizontals * all_horizontals,
                    name + fmt::format("horizontals found of {}", all_horizontals));
    expect_at_most(images_with_spurious, most_spurious * images, name + "images with a spurious point" + of);
  }
  double milliseconds() const { return 1e3 * seconds / images; }
};

double seconds_since(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

// 200 images each, at 0.3 px and, where unsuitable lines show, at 1 px.
TEST(Spec, AT21Detection) {
  constexpr int kImages = 200;
  for (const double sigma : {0.3, 1.0}) {
    Detection planes, circles;
    for (int image = 0; image < kImages; ++image) {
      const auto seed = static_cast<std::uint64_t>(image) + 1;
      std::mt19937_64 random(seed + 5000);
      Held held;
      held.roll = std::uniform_real_distribution<double>(-5, 5)(random) * kDegree;
      held.pitch = std::uniform_real_distribution<double>(-25, 25)(random) * kDegree;
      const SegmentScene scene = urban_scene(seed, held, 1 + image % 4, sigma);
      VanishingOptions options;
      options.seed = seed;
      const auto begin = std::chrono::steady_clock::now();
      const VanishingPoints found = find_vanishing_points(scene.planes(), options);
      planes.seconds += seconds_since(begin);
      std::vector<Eigen::Vector3d> axes;
      for (const VanishingPoint& p : found.points) axes.push_back(p.axis.direction);
      planes.count(axes, scene.axes);

      CircleOptions circle_options;
      circle_options.seed = seed;
      const auto middle = std::chrono::steady_clock::now();
      const auto circle_points =
          find_vanishing_points_by_circles(scene.lines(), scene.width, scene.height, circle_options);
      circles.seconds += seconds_since(middle);
      axes.clear();
      for (const CirclePoint& p : circle_points) {
        const Eigen::Vector2d off = p.point.pixel - scene.camera.centre;
        axes.push_back(Eigen::Vector3d(off.x(), off.y(), scene.camera.distance).normalized());
      }
      circles.count(axes, scene.axes);
    }
    int false_alarms = 0, false_circles = 0;
    for (int image = 0; image < kImages; ++image) {
      SegmentScene scene(static_cast<std::uint64_t>(image) + 9000, sigma);
      scene.add_clutter(static_cast<int>(scene.uniform(50, 400)));
      VanishingOptions options;
      options.seed = static_cast<std::uint64_t>(image);
      false_alarms += !find_vanishing_points(scene.planes(), options).points.empty();
      false_circles += !find_vanishing_points_by_circles(scene.lines(), scene.width, scene.height).empty();
    }
    const std::string by_planes = fmt::format("{} px, planes: ", sigma),
                      by_circles = fmt::format("{} px, circles: ", sigma),
                      alarms = fmt::format("false alarms of {} images of clutter", kImages);
    planes.expect(by_planes, 1, 0.96, 0.04);
    expect_at_most(false_alarms, 0.04 * kImages, by_planes + alarms);
    expect_at_most(planes.milliseconds(), 20, by_planes + "milliseconds per image");
    // For comparison; where lines are exact as published, but for one vertical of a hundred.
    std::printf("[ reached  ] %s%d verticals, %d of %d horizontals, %d images with a spurious point, %d %s, %.1f ms\n",
                by_circles.c_str(), circles.verticals, circles.horizontals, circles.all_horizontals,
                circles.images_with_spurious, false_circles, alarms.c_str(), circles.milliseconds());
    if (sigma > 0.5) continue;
    circles.expect(by_circles, 0.99, 0.92, 0.04);
    expect_at_most(false_circles, 0.04 * kImages, by_circles + alarms);
  }
}

TEST(Spec, AT22NearlyParallelFamilies) {
  constexpr int kImages = 200;
  const double apart[] = {16, 8, 4, 2, 1}, least[] = {1, 1, 0.97, 0.80, 0};
  for (int k = 0; k < 5; ++k) {
    int both = 0;
    for (int image = 0; image < kImages; ++image) {
      const auto seed = static_cast<std::uint64_t>(image) + 1;
      SegmentScene scene(seed);
      Held held;
      held.roll = scene.uniform(-5, 5) * kDegree;
      held.pitch = scene.uniform(-20, 20) * kDegree;
      const double azimuth = scene.uniform(20, 160) * kDegree;
      scene.add_family(held.vertical(), 60);
      scene.add_family(held.horizontal(azimuth), 50);
      scene.add_family(held.horizontal(azimuth + apart[k] * kDegree), 50);
      scene.add_clutter(40);
      VanishingOptions options;
      options.seed = seed;
      const VanishingPoints found = find_vanishing_points(scene.planes(), options);
      // Each by a point of its own.
      bool own[2] = {false, false};
      for (const VanishingPoint& p : found.points)
        for (std::size_t f = 0; f < 2; ++f) {
          const double here = axis_error_deg(p.axis.direction, scene.axes[1 + f]);
          own[f] = own[f] || (here < 0.5 && here < axis_error_deg(p.axis.direction, scene.axes[2 - f]));
        }
      both += own[0] && own[1];
    }
    expect_at_least(both / static_cast<double>(kImages), least[k],
                    fmt::format("families {} deg apart, share of images with both", apart[k]));
  }
}

TEST(Spec, AT23Levelling) {
  std::mt19937_64 random(23);
  std::normal_distribution<double> normal(0, 1);
  std::vector<Eigen::Vector3d> downs{Eigen::Vector3d::UnitY(), -Eigen::Vector3d::UnitY(),
                                     Eigen::Vector3d(1e-13, -1, 1e-14).normalized(),
                                     Eigen::Vector3d(0.2, 0.9, 0.3).normalized()};
  for (int i = 0; i < 10000; ++i) {
    const double x = normal(random), y = normal(random), z = normal(random);
    downs.push_back(Eigen::Vector3d(x, y, z).normalized());
    downs.push_back(Eigen::Vector3d(1e-7 * x, i % 2 ? 1 : -1, 1e-7 * z).normalized());
  }
  double off_axis = 0, determinant = 0, orthogonal = 0;
  for (const Eigen::Vector3d& down : downs) {
    const Eigen::Matrix3d r = levelling_rotation(down);
    keep_largest(off_axis, (r * down - Eigen::Vector3d::UnitY()).norm());
    keep_largest(determinant, std::abs(r.determinant() - 1));
    keep_largest(orthogonal, (r * r.transpose() - Eigen::Matrix3d::Identity()).norm());
  }
  expect_at_most(off_axis, 1e-12, fmt::format("largest |R V - Y| of {} directions", downs.size()));
  expect_at_most(determinant, 1e-12, "determinant less one");
  expect_at_most(orthogonal, 1e-12, "largest |R R' - I|");
}

// How often the vertical is found; with the orientation of portraits told or not.
double share_of_verticals(bool portraits, bool told) {
  constexpr int kSets = 250;
  constexpr int kCodeOfTurns[] = {1, 8, 3, 6};
  int right = 0;
  for (int set = 0; set < kSets; ++set) {
    const auto seed = static_cast<std::uint64_t>(set) + 1;
    std::mt19937_64 random(seed + 777);
    Held held;
    held.roll = std::uniform_real_distribution<double>(-10, 10)(random) * kDegree;
    held.pitch = std::uniform_real_distribution<double>(-30, 30)(random) * kDegree;
    if (portraits) held.quarter_turns = set % 4;
    const SegmentScene scene = urban_scene(seed, held, set % 5);
    VanishingOptions options;
    options.seed = seed;
    VerticalPrior prior;
    // The camera turned clockwise sees the ground turned the other way.
    if (told) prior.down = down_of_exif_orientation(kCodeOfTurns[held.quarter_turns]);
    const VanishingPoints found = find_vanishing_points(scene.planes(), options);
    const auto vertical = find_vertical(found.points, prior);
    right += vertical && (vertical->down.direction - scene.axes[0]).norm() < 0.5 * kDegree;
  }
  return right / static_cast<double>(kSets);
}

TEST(Spec, AT24Vertical) {
  expect_at_least(share_of_verticals(false, false), 1, "share of verticals, held upright");
  expect_at_least(share_of_verticals(true, true), 1, "share of verticals, held in four ways, Exif orientation told");
}

// Waits for the photographs; on others verticals are only plausible (tests/real/verticals_test.cpp).
TEST(Spec, AT25VerticalsOfPhotographs) {
  GTEST_SKIP() << "the photographs of entry-P10 (Strecha et al. 2008) are not available";
}

// Three images by a camera on a theodolite (X8), in grades: the angles from their three orthogonal vanishing points,
// and those of the instrument's circles. The angles are converted to the rays of the vanishing points and back. Besides
// them, differences between images are published, in which the instrument agrees except for the mounting of the camera.
TEST(Spec, AT28AnglesOfAPhototheodolite) {
  struct Picture {
    double omega, vertical_circle, phi, horizontal_circle;
  };
  constexpr double kGrade = 0.9 * kDegree;
  const std::array<Picture, 3> pictures{
      {{25.362, 326.058, 28.509, 393.131}, {33.809, 333.601, 46.415, 411.355}, {24.538, 325.087, 33.134, 395.983}}};
  std::array<YawPitchRoll, 3> read;
  double omega_error = 0, phi_error = 0, alone_error = 0;
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    const Eigen::Quaterniond rotation =
        rotation_from(YawPitchRoll{pictures[i].phi * kGrade, pictures[i].omega * kGrade, 0.03});
    std::vector<SeenAxis> axes;
    for (const Eigen::Vector3d& ground :
         {Eigen::Vector3d(0, 1, 0), Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(0, 0, -1)})
      axes.push_back({ground, {rotation * ground, 1e-8 * Eigen::Matrix3d::Identity()}});
    const auto attitude = attitude_from_axes(axes);
    ASSERT_TRUE(attitude);
    read[i] = yaw_pitch_roll(attitude->rotation_cw);
    keep_largest(omega_error, std::abs(read[i].pitch - pictures[i].omega * kGrade));
    keep_largest(phi_error, std::abs(read[i].yaw - pictures[i].phi * kGrade));
    keep_largest(alone_error, std::abs(roll_pitch_of(axes[2].seen).pitch - pictures[i].omega * kGrade));
  }
  expect_at_most(omega_error, 1e-9, "omega, rad");
  expect_at_most(phi_error, 1e-9, "phi, rad");
  expect_at_most(alone_error, 1e-9, "omega from the vertical alone, rad");
  struct Difference {
    std::size_t from, to;
    double omega, vertical_circle, phi, horizontal_circle, off_vertical, off_horizontal;
  };
  constexpr double kRounding = 0.0016;
  for (const Difference& d : {Difference{1, 0, -8.446, -7.543, -17.905, -18.224, -0.903, 0.318},
                              Difference{1, 2, -9.270, -8.514, -13.280, -15.372, -0.756, 2.091}}) {
    const Picture &a = pictures[d.from], &b = pictures[d.to];
    const double omega = (read[d.to].pitch - read[d.from].pitch) / kGrade;
    const double phi = (read[d.to].yaw - read[d.from].yaw) / kGrade;
    const std::string of = fmt::format("images {} and {}, gr: ", d.from + 1, d.to + 1);
    expect_within(omega, d.omega, kRounding, of + "difference of omega");
    expect_within(phi, d.phi, kRounding, of + "difference of phi");
    expect_within(omega - (b.vertical_circle - a.vertical_circle), d.off_vertical, kRounding,
                  of + "off that of the vertical circle");
    expect_within(phi - (b.horizontal_circle - a.horizontal_circle), d.off_horizontal, kRounding,
                  of + "off that of the horizontal circle");
  }
}

TEST(Spec, AT35SameBitsForTheSameSeed) {
  const SegmentScene scene = urban_scene(35, {0.05, -0.1}, 3);
  const VanishingPoints a = find_vanishing_points(scene.planes()), b = find_vanishing_points(scene.planes());
  ASSERT_EQ(a.points.size(), b.points.size());
  EXPECT_EQ(a.point_of, b.point_of);
  for (std::size_t i = 0; i < a.points.size(); ++i) {
    EXPECT_EQ(a.points[i].axis.direction, b.points[i].axis.direction);
    EXPECT_EQ(a.points[i].axis.covariance, b.points[i].axis.covariance);
  }
}

}  // namespace
}  // namespace megablock
