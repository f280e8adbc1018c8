#include "io/evaluation/remarks/camera_remarks.h"

#include <gmock/gmock.h>

#include "tests/support/io/made_up_result.h"

namespace megablock {
namespace {

// A result with one camera of 2 000 px, stated or guessed as `stated`, found as `found` with a sigma.
BlockResult with_focal(double stated, bool known, double found, double sigma) {
  BlockResult result = made_up_result(small_block());
  Camera& camera = result.block.cameras[CameraIndex(0)];
  camera.name = "phone";
  camera.intrinsics[kFocal] = stated;
  camera.focal_known = known;
  Intrinsics& values = result.state.cameras[CameraIndex(0)];
  values[kFocal] = found;
  result.camera_covariance = {};
  for (CameraIndex c(0); result.block.cameras.contains(c); ++c.value)
    result.camera_covariance.push_back(Eigen::MatrixXd::Zero(values.size(), values.size()));
  result.camera_covariance[CameraIndex(0)](kFocal, kFocal) = sigma * sigma;
  return result;
}

TEST(CameraRemarks, ARightFocalLengthGetsNone) {
  EXPECT_TRUE(camera_texts(with_focal(2000, true, 2030, 3)).empty());
  EXPECT_TRUE(camera_texts(with_focal(2400, false, 2000, 3)).empty()) << "a guess is no statement";
  EXPECT_TRUE(camera_texts(with_focal(2400, true, 2400, 0)).empty()) << "held";
  EXPECT_TRUE(camera_texts(with_focal(2000, true, 2250, 90)).empty()) << "too uncertain to contradict it";
}

TEST(CameraRemarks, NamesAFocalLengthThatIsHardlyDetermined) {
  EXPECT_THAT(
      camera_texts(with_focal(2400, false, 2011, 264)),
      testing::ElementsAre(testing::StartsWith("The focal length of camera 'phone' is hardly determined: 2011 +- "
                                               "264 px; depths are uncertain by its share of 13 %;")));
}

TEST(CameraRemarks, NamesAStatedFocalLengthThatTheBlockContradicts) {
  EXPECT_THAT(
      camera_texts(with_focal(2000, true, 2300, 4)),
      testing::ElementsAre(testing::StartsWith("The focal length of camera 'phone' is 2300 +- 4 px in the block, "
                                               "15 % more than the stated 2000 px: check the header")));
  EXPECT_THAT(camera_texts(with_focal(2000, true, 1600, 4)).at(0), testing::HasSubstr("20 % less than"));
}

}  // namespace
}  // namespace megablock
