#include "io/project/inputs/verticals.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geometry/numbers/angles.h"
#include "geometry/vanishing/vertical.h"
#include "io/base/error.h"
#include "tests/support/io/example_block.h"
#include "tests/support/io/image_files.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

using ::testing::HasSubstr;

class VerticalsFile : public ::testing::Test {
 protected:
  std::string message(const std::string& text) {
    try {
      read(text);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }
  Block read(const std::string& text) {
    fixture::write_file(scratch_.path("verticals.csv"), text);
    Block block = block_;
    read_verticals(scratch_.path("verticals.csv"), {"gone.jpg"}, block);
    check(block);
    return block;
  }

  ScratchDirectory scratch_;
  Block block_ = example_block();
  const std::string plain_ = "image,down_x,down_y,down_z,sigma_deg\n";
};

TEST_F(VerticalsFile, OfAnInclinometer) {
  const Block block = read(plain_ + "a/1.jpg,0,0,1,0.5\nb/0.jpg,0.6,0.8,0,0.1\n2.jpg,,,,\ngone.jpg,0,1,0,0.1\n");
  ASSERT_EQ(block.verticals.size(), 2u) << "in the order of images";
  EXPECT_EQ(block.verticals[0].image, ImageIndex(1));
  EXPECT_EQ(block.verticals[1].image, ImageIndex(2));
  EXPECT_EQ(block.verticals[1].down, Eigen::Vector3d::UnitZ()) << "an image that looks straight down";
  EXPECT_NEAR(block.verticals[1].covariance(0, 0), std::pow(0.5 * kDegree, 2), 1e-12);
  EXPECT_NEAR(block.verticals[1].covariance(2, 2), 0, 1e-15);
  EXPECT_EQ(block.verticals[0].camera.size(), 0);
}

// What is written comes back, however steeply the image looks down.
TEST_F(VerticalsFile, ComesBack) {
  for (const double pitch_deg : {0.0, -30.0, -89.0}) {
    SeenVertical seen;
    seen.image = ImageIndex(3);
    const double r = 3 * kDegree, p = pitch_deg * kDegree;
    seen.down = {std::sin(r) * std::cos(p), std::cos(r) * std::cos(p), -std::sin(p)};
    const Eigen::Matrix<double, 3, 2> plane = tangent_plane(seen.down);
    const Eigen::Matrix2d covariance{{4e-6, 1e-6}, {1e-6, 9e-6}};
    seen.covariance = plane * covariance * plane.transpose();
    const Intrinsics& camera = block_.cameras[block_.camera_of(seen.image)].intrinsics;
    seen.camera = Eigen::Map<const Eigen::VectorXd>(camera.data(), camera.size());
    seen.by_camera = Eigen::Matrix3Xd::Random(3, camera.size());
    const std::string name = block_.name_of(seen.image);
    const Block block = read(verticals_header() + ",segments\n" + verticals_row(seen, name) + ",12\n");
    ASSERT_EQ(block.verticals.size(), 1u);
    const SeenVertical& again = block.verticals[0];
    EXPECT_EQ(again.image, seen.image);
    EXPECT_LT((again.down - seen.down).norm(), 1e-11);
    EXPECT_LT((again.covariance - seen.covariance).norm(), 1e-7 * seen.covariance.norm());
    EXPECT_LT((again.camera - seen.camera).norm(), 1e-10 * seen.camera.norm());
    EXPECT_LT((again.by_camera - seen.by_camera).norm(), 1e-10 * seen.by_camera.norm());
  }
}

TEST_F(VerticalsFile, BadRowsAreNamed) {
  EXPECT_THAT(message(plain_ + "nowhere.jpg,0,1,0,0.1\n"),
              HasSubstr("verticals.csv:2: the block has no image 'nowhere.jpg'"));
  EXPECT_THAT(message(plain_ + "2.jpg,0,1,0,0.1\n2.jpg,0,1,0,0.1\n"), HasSubstr("verticals.csv:3: image '2.jpg'"));
  EXPECT_THAT(message(plain_ + "2.jpg,0,1,0,0\n"), HasSubstr("sigma_deg must lie in ["));
  EXPECT_THAT(message(plain_ + "2.jpg,nan,1,0,0.1\n"), HasSubstr("down_x"));
  EXPECT_THAT(message(plain_ + "2.jpg,0,1,0,nan\n"), HasSubstr("verticals.csv:2"));
  EXPECT_THAT(message(plain_ + "2.jpg,0,1,1,0.1\n"), HasSubstr("not a unit vector"));
  EXPECT_THAT(message("image,down_x,down_y,down_z\n2.jpg,0,1,0\n"), HasSubstr("sigma_roll_deg"));
  const std::string angles =
      "image,down_x,down_y,down_z,sigma_roll_deg,sigma_pitch_deg,correlation,camera,down_by_camera\n";
  EXPECT_THAT(message(angles + "2.jpg,0,1,0,0.1,0,0,,\n"), HasSubstr("sigma_pitch_deg"));
  EXPECT_THAT(message(angles + "2.jpg,0,1,0,0.1,0.1,1,,\n"), HasSubstr("correlation"));
  EXPECT_THAT(message(angles + "2.jpg,0,0,1,0.1,0.1,0,,\n"), HasSubstr("straight up or down"));
  EXPECT_THAT(message(angles + "2.jpg,0,1,0,0.1,0.1,0,1 2,1 2 3\n"), HasSubstr("three numbers for each"));
  EXPECT_THAT(message(angles + "2.jpg,0,1,0,0.1,0.1,0,1,1 x 3\n"), HasSubstr("'x' is not a number"));
  EXPECT_THAT(message(angles + "2.jpg,0,1,0,0.1,0.1,0,1,1 2 3\n"), HasSubstr("another camera model"));
}

// Names of images say little: 0001.jpg comes from every camera.
TEST_F(VerticalsFile, OfAnotherCameraIsRefused) {
  SeenVertical seen;
  seen.image = ImageIndex(3);
  seen.down = {0.1, std::sqrt(0.98), -0.1};
  seen.covariance = 1e-6 * (Eigen::Matrix3d::Identity() - seen.down * seen.down.transpose());
  const Camera& camera = block_.cameras[block_.camera_of(seen.image)];
  seen.by_camera = Eigen::Matrix3Xd::Zero(3, camera.intrinsics.size());
  const auto refusal = [&](int parameter, double change) {
    seen.camera = Eigen::Map<const Eigen::VectorXd>(camera.intrinsics.data(), camera.intrinsics.size());
    seen.camera[parameter] += change;
    return message(verticals_header() + "\n" + verticals_row(seen, block_.name_of(seen.image)) + "\n");
  };
  const double focal = camera.intrinsics[kFocal];
  EXPECT_EQ(refusal(kFocal, 0), "");
  EXPECT_EQ(refusal(kFocal, 0.1 * focal), "") << "calibrated since";
  EXPECT_THAT(refusal(kFocal, focal),
              HasSubstr("verticals.csv:2: the vertical was found with another camera than '" + camera.name + "': f "));
  EXPECT_THAT(refusal(kPrincipalX, 0.1 * camera.width), HasSubstr(": cx "));
}

// Sigmas of 4 px of focal length and 0.1 of the first radial term.
TEST_F(VerticalsFile, WholeErrorHasTheCameras) {
  SeenVertical seen;
  seen.image = ImageIndex(0);
  seen.covariance = Eigen::Vector3d(1e-6, 0, 1e-6).asDiagonal();
  Camera camera = block_.cameras[CameraIndex(0)];
  camera.prior_sigma.fill(0);
  camera.prior_sigma[kFocal] = 4;
  camera.prior_sigma[kRadial1] = 0.1;
  seen.camera = Eigen::Map<const Eigen::VectorXd>(camera.intrinsics.data(), camera.intrinsics.size());
  seen.by_camera = Eigen::Matrix3Xd::Zero(3, camera.intrinsics.size());
  seen.by_camera(0, kFocal) = 1e-3;
  seen.by_camera(2, kRadial1) = 0.02;
  const AxisDirection whole = whole_error(seen, camera, camera.intrinsics);
  EXPECT_EQ(whole.direction, seen.down);
  EXPECT_NEAR(whole.covariance(0, 0), 1e-6 + 16e-6, 1e-12);
  EXPECT_NEAR(whole.covariance(2, 2), 1e-6 + 4e-6, 1e-12);
  Intrinsics changed = camera.intrinsics;
  changed[kRadial1] += 0.5;
  EXPECT_NEAR(whole_error(seen, camera, changed).direction.z(), 0.01, 1e-6);
}

TEST_F(VerticalsFile, WhatIsSetAsideIsSaidByReason) {
  using enum VerticalVerdict;
  EXPECT_EQ(set_aside_text(block_, {}, 3), "");
  const std::string& first = block_.name_of(ImageIndex(0));
  const std::string& second = block_.name_of(ImageIndex(1));
  EXPECT_EQ(set_aside_text(block_, std::vector<SetAsideVertical>{{ImageIndex(1), kContradicted}}, 9),
            "1 of 9 verticals takes no part: 1 contradicted by most others (" + second + ")");
  const std::vector<SetAsideVertical> seven(7, {ImageIndex(0), kAgainstGround});
  EXPECT_THAT(set_aside_text(block_, seven, 20), HasSubstr(first + ", " + first + " and 2 more)"));
  const std::string all = set_aside_text(
      block_, std::vector<SetAsideVertical>{{ImageIndex(0), kNoConsensus}, {ImageIndex(1), kAgainstGround}}, 2);
  EXPECT_EQ(all, "2 of 2 verticals take no part: 1 that agree with too few others (" + first +
                     "), 1 contradicted by the positions or attitudes (" + second +
                     "); images from above show no vertical edges, remove their lines from the file of 'verticals'");
}

}  // namespace
}  // namespace megablock
