// Tests the files of relative poses: what they give to the block, and what they may not say.
#include "io/project/inputs/relative_poses_file.h"

#include <gmock/gmock.h>

#include "geometry/numbers/angles.h"
#include "io/base/error.h"
#include "io/project/inputs/frames_by_name.h"
#include "tests/support/io/image_files.h"
#include "tests/support/io/scratch_directory.h"
#include "tests/support/io/small_result.h"

namespace megablock {
namespace {

using fixture::message_of;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

// Frames frame0 to frame3 with two images each; the text is the file without its header.
class RelativePosesFile : public ::testing::Test {
 protected:
  const std::vector<RelativePose>& read(const std::string& lines) {
    fixture::write_file(file_, "from,to,qw,qx,qy,qz,x,y,z,sigma_position_m,sigma_rotation_deg\n" + lines);
    read_relative_poses(file_, {"frame9"}, block_, warnings_);
    return block_.relative_poses;
  }
  std::string refusal(const std::string& lines) {
    return message_of<InputError>([&] { read(lines); });
  }
  ScratchDirectory folder_;
  std::string file_ = folder_.path("relative.csv");
  Block block_ = fixture::small_result().block;
  std::vector<std::string> warnings_;
};

TEST_F(RelativePosesFile, NamesFramesOrTheirImages) {
  block_.relative_poses.push_back({FrameIndex(0), FrameIndex(3), {}, 1, 1});
  const auto& poses = read(
      "frame0,frame1,0,0,1,0,1,2,3,0.005,0.01\nframe2/1.jpg,frame1/0.jpg,1,0,0,0,-1,0,0.5,0.1,2\n"
      "frame9,frame1,1,0,0,0,0,0,0,1,1\n");
  ASSERT_EQ(poses.size(), 2u) << "those of the block give way";
  EXPECT_EQ(poses[0].from, FrameIndex(0));
  EXPECT_EQ(poses[0].to, FrameIndex(1));
  EXPECT_EQ(poses[0].pose.rotation.coeffs(), Eigen::Vector4d(0, 1, 0, 0));
  EXPECT_EQ(poses[0].pose.centre, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(poses[0].position_sigma_m, 0.005);
  EXPECT_EQ(poses[0].rotation_sigma_rad, 0.01 * kDegree);
  EXPECT_EQ(poses[1].from, FrameIndex(2));
  EXPECT_EQ(poses[1].to, frames_by_name(block_).at("frame1/1.jpg"));
  EXPECT_THAT(warnings_, ElementsAre(HasSubstr("relative.csv:4: the line is not used, because 'frame9' was left out")));
}

TEST_F(RelativePosesFile, ComesBackAsWritten) {
  const Eigen::Quaterniond turn = Eigen::Quaterniond(0.3, -0.2, 0.9, 0.1).normalized();
  block_.relative_poses = {{FrameIndex(2), FrameIndex(0), {turn, {1.0 / 3, -1e-7, 1e5 / 7}}, 0.03 * kDegree, 0.1 / 3}};
  const RelativePose written = block_.relative_poses[0];
  write_relative_poses(file_, block_);
  read_relative_poses(file_, {}, block_, warnings_);
  ASSERT_EQ(block_.relative_poses.size(), 1u);
  const RelativePose& read = block_.relative_poses[0];
  EXPECT_EQ(read.from, written.from);
  EXPECT_EQ(read.pose.rotation.coeffs(), written.pose.rotation.coeffs());
  EXPECT_EQ(read.pose.centre, written.pose.centre);
  EXPECT_EQ(read.position_sigma_m, written.position_sigma_m);
  EXPECT_EQ(read.rotation_sigma_rad, written.rotation_sigma_rad);
}

TEST_F(RelativePosesFile, RefusesWhatNoUserMeans) {
  const std::string rest = ",1,0,0,0,1,2,3,0.005,0.01\n";
  EXPECT_EQ(refusal("frame0,frame1" + rest + "frame1,frame0" + rest),
            file_ + ":3: the two frames have a relative pose in " + file_ + ":2 already; keep one line of them");
  EXPECT_THAT(refusal("frame0,frame8" + rest), HasSubstr(":2: to: the block has no image and no frame 'frame8'"));
  EXPECT_THAT(refusal("frame0/0.jpg,frame0/1.jpg" + rest), HasSubstr("'from' and 'to' belong to the same frame"));
  EXPECT_THAT(refusal("frame0,frame1,1,0,0,1,1,2,3,0.005,0.01\n"),
              HasSubstr(":2: qw,qx,qy,qz is not a unit quaternion"));
  EXPECT_THAT(refusal("frame0,frame1,1,0,0,0,1,2,3,0,0.01\n"), HasSubstr(":2: sigma_position_m must lie in [1e-08"));
  EXPECT_THAT(refusal("frame0,frame1,1,0,0,0,1,2,3,0.1,-1\n"), HasSubstr(":2: sigma_rotation_deg must lie in [1e-09"));
}

}  // namespace
}  // namespace megablock
