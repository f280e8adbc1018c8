// The vertical of rendered images of a street corner, against the attitude they were rendered with.
#include "match/images/image_vertical.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <Eigen/Eigenvalues>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <random>

#include "geometry/transform/rotation.h"
#include "io/images/image_codec.h"
#include "match/images/line_segments.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

namespace fs = std::filesystem;

// Windows on the two walls of a corner, seen by a tilted camera.
class ImageVerticalTest : public ::testing::Test {
 protected:
  void SetUp() override {
    camera_.width = 900;
    camera_.height = 600;
    camera_.intrinsics = Intrinsics{800, 450, 300};
  }

  // Camera axes in a ground frame with y down and z ahead.
  Eigen::Matrix3d attitude() const {
    return (Eigen::AngleAxisd(0.06, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(-0.15, Eigen::Vector3d::UnitX()) *
            Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY()))
        .toRotationMatrix();
  }
  std::string draw(bool windows) const {
    cv::Mat picture(600, 900, CV_8U, cv::Scalar(170));
    std::mt19937_64 random(4);
    const auto pixel = [&](const Eigen::Vector3d& ground) {
      const Eigen::Vector3d p = attitude() * ground;
      // Drawn with 4 fractional bits; OpenCV's (0, 0) is the centre of the first pixel.
      return cv::Point(static_cast<int>(std::lround(16 * (800 * p.x() / p.z() + 449.5))),
                       static_cast<int>(std::lround(16 * (800 * p.y() / p.z() + 299.5))));
    };
    if (windows)
      for (int wall = 0; wall < 2; ++wall)
        for (int column = 0; column < 7; ++column)
          for (int row = -4; row < 4; ++row) {
            // The walls recede to both sides of a corner 12 m ahead.
            const double jitter = 0.3 * std::uniform_real_distribution<double>(0, 1)(random);
            const auto at = [&](double along, double height) {
              const Eigen::Vector3d way = wall == 0 ? Eigen::Vector3d(-0.8, 0, -0.2) : Eigen::Vector3d(0.9, 0, 0.6);
              return pixel(Eigen::Vector3d(-2, height, 12) + along * way);
            };
            const double left = 0.5 + 1.5 * column + jitter, top = 1.6 * row + jitter;
            const std::vector<cv::Point> window{at(left, top), at(left + 0.9, top), at(left + 0.9, top + 1.1),
                                                at(left, top + 1.1)};
            cv::fillConvexPoly(picture, window, cv::Scalar(60), cv::LINE_AA, 4);
          }
    cv::GaussianBlur(picture, picture, {}, 0.7);
    const std::string file = scratch_.path(windows ? "windows.png" : "plain.png");
    write_image_file(file, picture);
    return file;
  }

  ScratchDirectory scratch_;
  Camera camera_;
};

TEST_F(ImageVerticalTest, IsFoundInAPicture) {
  const ImageVertical v = find_image_vertical(draw(true), camera_, {}, 1);
  EXPECT_EQ(v.failure, "");
  ASSERT_TRUE(v.found);
  const Eigen::Vector3d truth = attitude() * Eigen::Vector3d::UnitY();
  const double error = std::acos(v.down.direction.dot(truth)) * kDegreesPerRadian;
  EXPECT_LT(error, 0.1);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(v.down.covariance);
  const double sigma = std::sqrt(solver.eigenvalues()(2)) * kDegreesPerRadian;
  EXPECT_LT(error, 4 * sigma) << "what it says of itself";
  EXPECT_LT(sigma, 0.2);
  EXPECT_GT(v.lines, 20);

  // The result is repeatable, and the derivatives show the effect of the camera's errors.
  EXPECT_EQ(find_image_vertical(draw(true), camera_, {}, 1).down.direction, v.down.direction);
  for (const IntrinsicParameter p : {kFocal, kPrincipalX, kPrincipalY, kRadial1}) {
    Camera changed = camera_;
    const double change = p == kRadial1 ? 0.02 : 4;
    changed.intrinsics[p] += change;
    const Eigen::Vector3d difference =
        find_image_vertical(draw(true), changed, {}, 1).down.direction - v.down.direction;
    EXPECT_LT((difference - change * v.by_camera.col(p)).norm(), 0.15 * difference.norm() + 5e-5) << p;
  }
}

// Two and a half times as large: the image is searched in reduced form, in which most windows are too small, and then
// in full for what is found.
TEST_F(ImageVerticalTest, IsFoundInALargePictureByAllItsEdges) {
  const std::string file = scratch_.path("large.png");
  cv::Mat picture = read_image_file(draw(true), cv::IMREAD_GRAYSCALE);
  cv::resize(picture, picture, {}, 2.5, 2.5, cv::INTER_CUBIC);
  write_image_file(file, picture);
  camera_.width = 2250;
  camera_.height = 1500;
  camera_.intrinsics = Intrinsics{2000, 1125, 750};
  const ImageVertical v = find_image_vertical(file, camera_, {}, 1);
  ASSERT_TRUE(v.found);
  EXPECT_EQ(v.segments, std::ssize(find_line_segments(picture, {})));
  const Eigen::Vector3d truth = attitude() * Eigen::Vector3d::UnitY();
  EXPECT_LT(std::acos(v.down.direction.dot(truth)) * kDegreesPerRadian, 0.1);
}

// Edges too short for the reduced image still count.
TEST_F(ImageVerticalTest, ALargePictureOfShortEdgesHasEdges) {
  camera_.width = 2250;
  camera_.height = 1500;
  camera_.intrinsics = Intrinsics{2000, 1125, 750};
  cv::Mat picture(1500, 2250, CV_8U, cv::Scalar(170));
  for (int x = 100; x < 2200; x += 150)
    for (int y = 100; y < 1400; y += 150)
      cv::line(picture, cv::Point(x, y), cv::Point(x + 25, y + 30), cv::Scalar(60), 7, cv::LINE_AA);
  const std::string file = scratch_.path("short.png");
  write_image_file(file, picture);
  SegmentOptions reduced;
  reduced.max_megapixels = 0.5;
  reduced.min_length_px = 20;
  ASSERT_TRUE(find_line_segments(picture, {}, reduced).empty());
  EXPECT_EQ(find_image_vertical(file, camera_, {}, 1).segments, std::ssize(find_line_segments(picture, {})));
}

// If the edges of a large image have random directions, only the reduced image is searched.
TEST_F(ImageVerticalTest, ALargePictureWithoutAVerticalIsLookedAtOnce) {
  camera_.width = 2250;
  camera_.height = 1500;
  camera_.intrinsics = Intrinsics{2000, 1125, 750};
  for (const unsigned seed : {1u, 2u, 3u}) {
    cv::Mat picture(1500, 2250, CV_8U, cv::Scalar(170));
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> uniform(0, 1);
    for (int bar = 0; bar < 200; ++bar) {
      const double x = 2250 * uniform(random), y = 1500 * uniform(random), angle = EIGEN_PI * uniform(random);
      const double length = bar % 4 == 0 ? 120 : 40;  // most are too short for the reduced image
      const cv::Point2d along(length * std::cos(angle), length * std::sin(angle));
      cv::line(picture, cv::Point2d(x, y), cv::Point2d(x, y) + along, cv::Scalar(60), 7, cv::LINE_AA);
    }
    const std::string file = scratch_.path("clutter.png");
    write_image_file(file, picture);
    const ImageVertical v = find_image_vertical(file, camera_, {}, 1);
    EXPECT_FALSE(v.found);
    EXPECT_GT(v.segments, 20);
    EXPECT_LT(2 * v.segments, std::ssize(find_line_segments(picture, {}))) << "of the whole image";
  }
}

TEST_F(ImageVerticalTest, NoneWithoutEdgesAndForBadFiles) {
  const ImageVertical plain = find_image_vertical(draw(false), camera_, {}, 1);
  EXPECT_EQ(plain.failure, "");
  EXPECT_FALSE(plain.found);
  EXPECT_EQ(plain.segments, 0);

  const ImageVertical missing = find_image_vertical(scratch_.path("gone.jpg"), camera_, {}, 1);
  EXPECT_FALSE(missing.failure.empty());
  EXPECT_FALSE(missing.found);
  const std::string windows = draw(true);
  Camera other = camera_;
  other.width = 901;
  EXPECT_NE(find_image_vertical(windows, other, {}, 1).failure.find("900 x 600"), std::string::npos);
  other = camera_;
  other.mask_path = scratch_.path("mask.png");
  EXPECT_NE(find_image_vertical(windows, other, {}, 1).failure.find("mask"), std::string::npos);
  write_image_file(other.mask_path, cv::Mat(600, 900, CV_8U, cv::Scalar(0)));
  const ImageVertical masked = find_image_vertical(windows, other, {}, 1);
  EXPECT_EQ(masked.failure, "");
  EXPECT_EQ(masked.segments, 0);
}

}  // namespace
}  // namespace megablock
