// Vanishing points of simulated images: families of lines and their members, bad input, and the binomial tail they are
// tested with.
#include "geometry/vanishing/vanishing_points.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "geometry/numbers/binomial.h"
#include "geometry/vanishing/vanishing_circles.h"
#include "tests/support/geometry/segment_scenes.h"

namespace megablock {
namespace {

using fixture::axis_error_deg;
using fixture::Held;
using fixture::SegmentScene;
using fixture::urban_scene;

TEST(BinomialTail, SmallNumbersByEnumeration) {
  for (const double p : {0.02, 0.5, 0.93}) {
    double tail = 0;
    for (int k = 12; k >= 0; --k) {
      double term = 1;
      for (int i = 0; i < k; ++i) term *= p * (12 - i) / (i + 1);
      tail += term * std::pow(1 - p, 12 - k);
      EXPECT_NEAR(std::pow(10, log10_binomial_tail(12, k, p)) / tail, 1, 1e-10) << k << ' ' << p;
    }
  }
}

TEST(BinomialTail, Ends) {
  EXPECT_EQ(log10_binomial_tail(10, 0, 0.3), 0);
  EXPECT_EQ(log10_binomial_tail(10, 11, 0.3), -std::numeric_limits<double>::infinity());
  EXPECT_EQ(log10_binomial_tail(10, 3, 0), -std::numeric_limits<double>::infinity());
  EXPECT_EQ(log10_binomial_tail(10, 10, 1), 0);
  EXPECT_NEAR(log10_binomial_tail(5000, 5000, 1e-3), -15000, 1e-6) << "below the smallest number";
  EXPECT_NEAR(log10_binomial_tail(100000, 1, 0.5), 0, 1e-9) << "far below the mean";
}

TEST(VanishingPoints, FindsFamiliesAndTheirLines) {
  const SegmentScene scene = urban_scene(3, Held{0.04, -0.2}, 2);
  const VanishingPoints found = find_vanishing_points(scene.planes());
  ASSERT_EQ(found.points.size(), 3u);
  for (std::size_t a = 0; a < 3; ++a) {
    const auto at = std::find_if(found.points.begin(), found.points.end(), [&](const VanishingPoint& p) {
      return axis_error_deg(p.axis.direction, scene.axes[a]) < 0.3;
    });
    ASSERT_NE(at, found.points.end());
    int own = 0, all = 0;
    for (std::size_t i = 0; i < scene.family.size(); ++i) {
      all += scene.family[i] == static_cast<int>(a);
      own += scene.family[i] == static_cast<int>(a) && found.point_of[i] == at - found.points.begin();
    }
    EXPECT_GE(own, 0.9 * all) << "lines bear the number of their vanishing point";
    EXPECT_LT(at->log10_nfa, -10);
    EXPECT_NEAR(at->weighted_squares / static_cast<double>(at->redundancy), 1, 0.5);
  }
}

// Unknown cameras, and images in which half of the lines are too short.
TEST(VanishingPoints, WithoutCalibrationAndWithShortLines) {
  SegmentScene scene = urban_scene(4, Held{-0.03, 0.1}, 2);
  scene.add_clutter(400, 5, 30);
  const PerspectiveCentre any = perspective_centre(scene.width, scene.height);
  const VanishingPoints found = find_vanishing_points(scene.planes(any));
  EXPECT_EQ(found.points.size(), 3u);
  for (const Eigen::Vector3d& axis : scene.axes)
    EXPECT_TRUE(std::any_of(found.points.begin(), found.points.end(), [&](const VanishingPoint& p) {
      return axis_error_deg(seen_from(p.axis, any, scene.camera).direction, axis) < 0.3;
    }));
}

TEST(VanishingPoints, FewOrNoLines) {
  EXPECT_TRUE(find_vanishing_points({}).points.empty());
  SegmentScene scene;
  for (int count = 1; count < 4; ++count) {
    scene.add_family(Eigen::Vector3d::UnitY(), 1);
    const VanishingPoints found = find_vanishing_points(scene.planes());
    EXPECT_TRUE(found.points.empty()) << count;
    EXPECT_EQ(found.point_of, std::vector<int>(static_cast<std::size_t>(count), -1));
  }
  EXPECT_FALSE(fit_axis({}));
  EXPECT_FALSE(fit_axis(std::vector(1, scene.planes().front())));
}

TEST(VanishingPoints, AllSegmentsOnOneLine) {
  SegmentScene scene;
  for (int i = 0; i < 60; ++i) scene.add({200.0 + 40 * i, 300.0 + 10 * i}, {4, 1}, scene.uniform(80, 300), -1);
  EXPECT_TRUE(find_vanishing_points(scene.planes()).points.empty());
  scene.add_clutter(100);
  EXPECT_TRUE(find_vanishing_points(scene.planes()).points.empty()) << "any axis in its plane would hold them";
  // It must not hide true vanishing points either.
  scene.add_family(Held{0.1, 0.2}.vertical(), 40);
  const VanishingPoints found = find_vanishing_points(scene.planes());
  ASSERT_EQ(found.points.size(), 1u);
  EXPECT_LT(axis_error_deg(found.points[0].axis.direction, scene.axes[0]), 0.3);
}

TEST(VanishingPoints, Duplicates) {
  SegmentScene scene;
  scene.add_clutter(60);
  auto planes = scene.planes();
  const auto once = planes;
  for (int copy = 0; copy < 30; ++copy) planes.insert(planes.end(), once.begin(), once.begin() + 5);
  EXPECT_TRUE(find_vanishing_points(planes).points.empty()) << "five lines, thirty times";
  const std::vector<InterpretationPlane> same(50, once.front());
  EXPECT_TRUE(find_vanishing_points(same).points.empty());
  EXPECT_FALSE(fit_axis(same));
}

TEST(VanishingPoints, LinesThatAreNoNumbers) {
  SegmentScene scene = urban_scene(8, Held{}, 1);
  auto planes = scene.planes();
  const VanishingPoints clean = find_vanishing_points(planes);
  const std::size_t count = planes.size();
  const double nan = std::numeric_limits<double>::quiet_NaN(), infinite = std::numeric_limits<double>::infinity();
  for (int k = 0; k < 5; ++k) planes.push_back(planes[static_cast<std::size_t>(k)]);
  planes[count].normal.x() = nan;
  planes[count + 1].covariance(1, 1) = infinite;
  planes[count + 2].normal.setZero();
  planes[count + 3].covariance.setZero();
  planes[count + 4].normal *= 100;
  const VanishingPoints found = find_vanishing_points(planes);
  ASSERT_EQ(found.points.size(), clean.points.size());
  for (std::size_t i = 0; i < clean.points.size(); ++i)
    EXPECT_EQ(found.points[i].axis.direction, clean.points[i].axis.direction);
  for (std::size_t i = count; i < planes.size(); ++i) EXPECT_EQ(found.point_of[i], -1);
  for (InterpretationPlane& plane : planes) plane.covariance.setZero();
  EXPECT_TRUE(find_vanishing_points(planes).points.empty());
}

// A narrow bundle of lines must be told from a family.
TEST(VanishingPoints, ANarrowBundleHasNone) {
  SegmentScene scene;
  for (int i = 0; i < 12; ++i) scene.add({1500.0 + 6 * i, 1000}, {0, 1}, 200, -1);
  EXPECT_TRUE(find_vanishing_points(scene.planes()).points.empty());
}

TEST(VanishingCircles, FindsFamiliesAndRefusesBadInput) {
  const Held held{0.04, -0.2};
  SegmentScene scene = urban_scene(3, held, 2);
  const auto found = find_vanishing_points_by_circles(scene.lines(), scene.width, scene.height);
  EXPECT_EQ(found.size(), 3u);
  for (const Eigen::Vector3d& axis : scene.axes)
    EXPECT_TRUE(std::any_of(found.begin(), found.end(), [&](const CirclePoint& p) {
      const Eigen::Vector2d off = p.point.pixel - scene.camera.centre;
      return axis_error_deg(Eigen::Vector3d(off.x(), off.y(), scene.camera.distance).normalized(), axis) < 0.3;
    }));

  EXPECT_TRUE(find_vanishing_points_by_circles({}, 100, 100).empty());
  std::vector<ImageLine> lines = scene.lines();
  lines[0].theta = std::numeric_limits<double>::quiet_NaN();
  lines[1].covariance(0, 0) = std::numeric_limits<double>::infinity();
  EXPECT_EQ(find_vanishing_points_by_circles(lines, scene.width, scene.height).size(), 3u);
  EXPECT_FALSE(fit_vanishing_circle({}));
  EXPECT_FALSE(fit_vanishing_circle(std::vector(6, lines[3])));
  EXPECT_FALSE(fit_vanishing_circle_algebraic(std::vector(6, lines[3])));
}

}  // namespace
}  // namespace megablock
