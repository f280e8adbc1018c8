// Camera matrices: the parts of a known camera come back, whatever the scale and sign of its matrix.
#include "geometry/camera/camera_matrix.h"

#include <gtest/gtest.h>

#include "tests/support/geometry/pair_scene.h"

namespace megablock {
namespace {

TEST(CameraMatrix, WithoutAPointKeepsTheImagesOrientation) {
  std::mt19937_64 random(81);
  CameraMatrixParts truth;
  truth.calibration << 1000, 0.5, 20, 0, 1010, -30, 0, 0, 1;
  for (const double scale : {1.0, -2.0}) {
    truth.pose = {rotation_exp<double>(2 * random_direction(random)), 100 * random_direction(random)};
    const auto found = decompose_camera_matrix(scale * camera_matrix(truth));
    ASSERT_TRUE(found);
    EXPECT_LT((found->calibration - truth.calibration).norm(), 1e-9);
    EXPECT_LT(rotation_angle(found->pose.rotation, truth.pose.rotation), 1e-12);
    EXPECT_LT((found->pose.centre - truth.pose.centre).norm(), 1e-9);
  }
}

TEST(CameraMatrix, RefusesWhatHasNoCentre) {
  CameraMatrix p;
  p << 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 1;
  EXPECT_FALSE(decompose_camera_matrix(p)) << "parallel projection";
  p << 1, 2, 3, 4, 2, 4, 6, 8, 0, 0, 1, 1;
  EXPECT_FALSE(decompose_camera_matrix(p)) << "two rows along one another";
  p << 1, 0, 0, 0, 0, 1, 0, 0, 0, std::nan(""), 1, 1;
  EXPECT_FALSE(decompose_camera_matrix(p));
}

}  // namespace
}  // namespace megablock
