// The image formula in nine and in eleven parameters: conversions against each other, fits against simulated truth, and
// refusal of degenerate control.
#include "geometry/camera/collinearity.h"

#include <gtest/gtest.h>

#include "tests/support/geometry/pair_scene.h"

namespace megablock {
namespace {

NineParameters tilted_image() {
  NineParameters image;
  image.rotation = rotation_exp<double>({0.3, -0.2, 1.5}).toRotationMatrix();
  image.centre = {20, -30, 500};
  image.principal_point = {12, -7};
  image.principal_distance = 1500;
  return image;
}

struct ControlScene {
  std::vector<Eigen::Vector3d> ground;
  std::vector<Eigen::Vector2d> image;

  ControlScene(const NineParameters& camera, std::size_t count, double relief, std::mt19937_64& random,
               double noise = 0) {
    std::uniform_real_distribution<double> uniform(-1, 1);
    std::normal_distribution<double> normal(0, 1);
    const Eigen::Vector3d below = origin_before(camera, 500);
    for (std::size_t i = 0; i < count; ++i) {
      ground.push_back(below + Eigen::Vector3d(150 * uniform(random), 150 * uniform(random), relief * uniform(random)));
      image.push_back(project(camera, ground.back()) + noise * Eigen::Vector2d(normal(random), normal(random)));
    }
  }
};

TEST(Collinearity, OriginInThePlaneOfTheCentreIsRefused) {
  const NineParameters image = tilted_image();
  const Eigen::Vector3d along = image.rotation.row(0);
  EXPECT_FALSE(eleven_from(image, image.centre + 100 * along));
  EXPECT_FALSE(eleven_from(image, image.centre));
  EXPECT_TRUE(eleven_from(image, origin_before(image, 100)));
  EXPECT_TRUE(eleven_from(image, origin_before(image, -100)));
}

TEST(Collinearity, NumbersThatAreNoneAreRefused) {
  const double nan = std::nan("");
  const NineParameters good = tilted_image();
  ASSERT_TRUE(eleven_from(good, {0, 0, 0}));
  EXPECT_FALSE(eleven_from(good, {0, nan, 0}));
  NineParameters bad = good;
  bad.centre.x() = nan;
  EXPECT_FALSE(eleven_from(bad, {0, 0, 0}));
  bad = good;
  bad.rotation(2, 1) = nan;
  EXPECT_FALSE(eleven_from(bad, {0, 0, 0}));
  for (double ElevenParameters::*number : {&ElevenParameters::a4, &ElevenParameters::b4}) {
    ElevenParameters e = eleven_from(good, {0, 0, 0}).value();
    e.*number = nan;
    EXPECT_FALSE(nine_from(e));
  }
  for (Eigen::Vector3d ElevenParameters::*row : {&ElevenParameters::a, &ElevenParameters::b, &ElevenParameters::c})
    for (int k = 0; k < 3; ++k) {
      ElevenParameters e = eleven_from(good, {0, 0, 0}).value();
      (e.*row)[k] = nan;
      EXPECT_FALSE(nine_from(e)) << k;
    }
}

TEST(Collinearity, DisagreementOfElevenParametersShows) {
  ElevenParameters e = eleven_from(tilted_image(), {0, 0, 0}).value();
  const auto exact = nine_from(e);
  ASSERT_TRUE(exact);
  EXPECT_NEAR(exact->skew, 0, 1e-13);
  EXPECT_NEAR(exact->distance_ratio, 1, 1e-13);
  e.b *= 1.001;
  EXPECT_NEAR(nine_from(e)->distance_ratio, 1.001, 1e-4);
  e.a += 1e-3 * e.b;
  EXPECT_GT(std::abs(nine_from(e)->skew), 5e-4);
}

TEST(Collinearity, ProjectionsWithoutACentreAreRefused) {
  ElevenParameters e = eleven_from(tilted_image(), {0, 0, 0}).value();
  e.c.setZero();
  EXPECT_FALSE(nine_from(e)) << "parallel projection";
  e = eleven_from(tilted_image(), {0, 0, 0}).value();
  e.b = e.a;
  EXPECT_FALSE(nine_from(e)) << "the image is a line";
  e.b.x() = std::nan("");
  EXPECT_FALSE(nine_from(e));
}

TEST(Collinearity, FitNeedsSixPointsThatAreNotInOnePlane) {
  std::mt19937_64 random(61);
  const NineParameters camera = tilted_image();
  const ControlScene five(camera, 5, 40, random), plane(camera, 20, 0, random, 0.5), good(camera, 8, 40, random);
  EXPECT_FALSE(fit_eleven(five.ground, five.image));
  EXPECT_FALSE(fit_eleven(plane.ground, plane.image));
  std::vector<Eigen::Vector3d> line = good.ground, bad = good.ground;
  for (std::size_t i = 0; i < 8; ++i) line[i] = static_cast<double>(i) * Eigen::Vector3d(1, 2, 0.5);
  EXPECT_FALSE(fit_eleven(line, good.image));
  EXPECT_FALSE(fit_eleven(std::vector<Eigen::Vector3d>(8, Eigen::Vector3d::Ones()), good.image));
  bad[3].z() = std::nan("");
  EXPECT_FALSE(fit_eleven(bad, good.image));
  EXPECT_FALSE(fit_nine(camera, bad, good.image));
  EXPECT_FALSE(fit_nine(camera, line, good.image));
  std::vector<Eigen::Vector2d> unknown = good.image;
  unknown[3].y() = std::nan("");
  EXPECT_FALSE(fit_eleven(good.ground, unknown));
  EXPECT_FALSE(fit_nine(camera, good.ground, unknown));
  std::vector<Eigen::Vector3d> behind = good.ground;
  behind[0] = origin_before(camera, -500);
  EXPECT_FALSE(fit_nine(camera, behind, good.image));
  const std::vector<Eigen::Vector3d> four(good.ground.begin(), good.ground.begin() + 4);
  EXPECT_FALSE(fit_nine(camera, four, std::vector<Eigen::Vector2d>(good.image.begin(), good.image.begin() + 4)));
}

TEST(Collinearity, APointMeasuredTwiceCountsOnce) {
  const NineParameters camera = tilted_image();
  std::mt19937_64 random(64);
  for (const double noise : {0.0, 0.5})
    for (const double apart : {0.0, 1e-4}) {  // metres, of 300 m
      ControlScene twice(camera, 6, 40, random, noise);
      ASSERT_TRUE(fit_eleven(twice.ground, twice.image));
      ASSERT_TRUE(fit_nine(camera, twice.ground, twice.image));
      const Eigen::Vector2d error = twice.image[5] - project(camera, twice.ground[5]);
      twice.ground[5] = twice.ground[1] + apart * Eigen::Vector3d::UnitZ();
      twice.image[5] = project(camera, twice.ground[5]) + error;
      EXPECT_FALSE(fit_eleven(twice.ground, twice.image)) << "five points, noise " << noise << " px";
      EXPECT_TRUE(fit_nine(camera, twice.ground, twice.image)) << "five points are enough";
      twice.ground.erase(twice.ground.begin());
      twice.image.erase(twice.image.begin());
      EXPECT_FALSE(fit_nine(camera, twice.ground, twice.image)) << "four points, noise " << noise << " px";
    }
}

TEST(Collinearity, CofactorsPredictTheErrors) {
  std::mt19937_64 random(62);
  const NineParameters truth = tilted_image();
  constexpr int kTrials = 400;
  double normalised = 0, squares = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    const ControlScene scene(truth, 20, 60, random, 0.5);
    const auto fitted = fit_nine(truth, scene.ground, scene.image);
    ASSERT_TRUE(fitted);
    Eigen::Matrix<double, 9, 1> error;
    const Eigen::Quaterniond turn(Eigen::Matrix3d(truth.rotation.transpose() * fitted->image.rotation));
    error << rotation_log<double>(turn), fitted->image.centre - truth.centre,
        fitted->image.principal_point - truth.principal_point,
        fitted->image.principal_distance - truth.principal_distance;
    normalised += error.dot(fitted->cofactors.inverse() * error) / 0.25 / 9 / kTrials;
    squares += fitted->squares / 0.25 / 31 / kTrials;
  }
  EXPECT_NEAR(normalised, 1, 0.1);
  EXPECT_NEAR(squares, 1, 0.05);
}

TEST(Collinearity, RestitutionOfBadInput) {
  std::mt19937_64 random(63);
  const NineParameters image = tilted_image();
  const ElevenParameters e = eleven_from(image, {0, 0, 0}).value();
  const std::vector<ElevenParameters> one = {e}, same = {e, e};
  EXPECT_FALSE(restitute(one, std::vector<Eigen::Vector2d>{{1, 2}}));
  EXPECT_FALSE(restitute(same, std::vector<Eigen::Vector2d>{{1, 2}, {1, 2}})) << "no base";
  EXPECT_FALSE(restitute(same, std::vector<Eigen::Vector2d>{{1, 2}, {std::nan(""), 2}}));
}

// Points behind the image are refused, whichever side of the image the origin lies on.
TEST(Collinearity, RestitutionRefusesPointsBehindTheImages) {
  const NineParameters first = tilted_image();
  NineParameters second = first;
  second.centre += 20 * first.rotation.row(0).transpose();
  const Eigen::Vector3d ahead = -first.rotation.row(2).transpose();
  for (const double origin_at : {150.0, -150.0})
    for (const double point_at : {100.0, -100.0}) {
      const Eigen::Vector3d origin = first.centre + origin_at * ahead, point = first.centre + point_at * ahead;
      const std::vector<ElevenParameters> images = {eleven_from(first, origin).value(),
                                                    eleven_from(second, origin).value()};
      EXPECT_EQ(in_front(images[0], point), in_front(first, point));
      const auto found = restitute(images, std::vector<Eigen::Vector2d>{project(first, point), project(second, point)});
      ASSERT_EQ(found.has_value(), point_at > 0) << origin_at;
      if (found.has_value()) {
        EXPECT_LT((*found - point).norm(), 1e-6);
      }
    }
}

}  // namespace
}  // namespace megablock
