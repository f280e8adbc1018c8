#include "io/project/inputs/approximate_poses.h"

#include <gmock/gmock.h>

#include "geometry/numbers/angles.h"
#include "io/base/error.h"
#include "io/exchange/export.h"
#include "io/project/inputs/pose_csv.h"
#include "io/project/project.h"
#include "tests/support/io/image_files.h"
#include "tests/support/io/scratch_directory.h"
#include "tests/support/io/small_result.h"

namespace megablock {
namespace {

using fixture::gps_tags;
using fixture::message_of;
using fixture::small_result;
using fixture::write_file;
using fixture::write_image_file;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

// What the export wrote comes back as given poses of the frames, rigs included, whatever the names.
TEST(ApproximatePoses, ReadWhatTheExportWrites) {
  ScratchDirectory folder;
  BlockResult result = small_result();
  fixture::name_oddly(result.block);
  export_result(result, "csv", folder.path("out"));
  for (const std::string name : {"frames.csv", "images_local.csv", "images_wgs84.csv"}) {
    Block block = result.block;
    std::vector<std::string> warnings;
    set_given_poses(read_approximate_poses(folder.path("out/" + name)), {}, block, warnings);
    for (const FrameIndex f : {FrameIndex(0), FrameIndex(1), FrameIndex(3)}) {
      ASSERT_TRUE(block.frames[f].given_pose) << name;
      EXPECT_LT((block.frames[f].given_pose->centre - result.state.frames[f].centre).norm(), 2e-5) << name;
      EXPECT_LT(rotation_angle(block.frames[f].given_pose->rotation, result.state.frames[f].rotation), 1e-9) << name;
    }
    EXPECT_FALSE(block.frames[FrameIndex(2)].given_pose);
  }
}

// A pose by the name of the second camera of a rig gives the frame's.
TEST(ApproximatePoses, OfAnyImageOfARig) {
  ScratchDirectory folder;
  const BlockResult result = small_result();
  export_result(result, "csv", folder.path("out"));
  std::istringstream lines(fixture::read_file(folder.path("out/images_local.csv")));
  std::string header, first, second;
  std::getline(lines, header);
  std::getline(lines, first);
  std::getline(lines, second);
  write_file(folder.path("p.csv"), header + "\n" + second + "\n");
  Block block = result.block;
  std::vector<std::string> warnings;
  set_given_poses(read_approximate_poses(folder.path("p.csv")), {}, block, warnings);
  const Pose& pose = *block.frames[FrameIndex(0)].given_pose;
  EXPECT_LT((pose.centre - result.state.frames[FrameIndex(0)].centre).norm(), 1e-9);
  EXPECT_LT(rotation_angle(pose.rotation, result.state.frames[FrameIndex(0)].rotation), 1e-9);
}

TEST(ApproximatePoses, FramesOfAnotherOriginAreTurned) {
  ScratchDirectory folder;
  const BlockResult result = small_result();
  write_pose_csv(folder.path("p.csv"), pose_table(result.block, result.state));
  Block block = result.block;
  block.ground = {true, 46.9, -92.1, 150, "EPSG:4979"};
  std::vector<std::string> warnings;
  set_given_poses(read_approximate_poses(folder.path("p.csv")), {}, block, warnings);
  const Georeference before(result.block.ground), after(block.ground);
  const Pose &pose = *block.frames[FrameIndex(0)].given_pose, &given = result.state.frames[FrameIndex(0)];
  for (const Eigen::Vector3d& point : {Eigen::Vector3d(0, 0, 0), {30, -20, 5}}) {
    const Eigen::Vector3d moved = after.to_local(before.to_geodetic(point));
    EXPECT_LT((to_inside(pose, moved) - to_inside(given, point)).norm(), 1e-6);
  }
}

TEST(ApproximatePoses, OfAProjectGiveTheOriginAndTheFrames) {
  ScratchDirectory folder;
  write_image_file(folder.path("images/a.jpg"), 64, 48, 1);
  write_image_file(folder.path("images/b.jpg"), 64, 48, 2);
  write_file(folder.path("images/broken.jpg"), "");
  write_file(folder.path("poses.csv"),
             "image,latitude_deg,longitude_deg,height_m,gimbal_yaw_deg,gimbal_pitch_deg,gimbal_roll_deg,note\n"
             "a.jpg,52.5201,13.4002,140,90,-90,0,first\nbroken.jpg,52.52,13.4,140,0,0,0,\n");
  write_file(folder.path("block.yaml"), "images: images\nposes: poses.csv\n");
  const Project project = read_project(folder.path("block.yaml"));
  EXPECT_DOUBLE_EQ(project.block.ground.latitude_deg, 52.52);
  ASSERT_TRUE(project.block.frames[FrameIndex(0)].given_pose);
  EXPECT_FALSE(project.block.frames[FrameIndex(1)].given_pose);
  const Pose& pose = *project.block.frames[FrameIndex(0)].given_pose;
  EXPECT_NEAR(pose.centre.y(), 11.13, 0.01);
  // Nadir, top of the image to the east.
  EXPECT_LT((pose.rotation * Eigen::Vector3d::UnitX() - Eigen::Vector3d(0, -1, 0)).norm(), 1e-4);
  EXPECT_LT((pose.rotation * Eigen::Vector3d::UnitZ() - Eigen::Vector3d(0, 0, -1)).norm(), 1e-4);
  EXPECT_THAT(project.warnings, ElementsAre(HasSubstr("broken.jpg")));
}

// The same nadir image, its top to the east, in the three kinds of angles.
TEST(ApproximatePoses, AnglesOfBodyGimbalAndPhotoAgree) {
  ScratchDirectory folder;
  const std::vector<std::string> tables = {
      "yaw_deg,pitch_deg,roll_deg\nframe0/0.jpg,1,2,3,90,0,0\n",
      "gimbal_yaw_deg,gimbal_pitch_deg,gimbal_roll_deg\nframe0/0.jpg,1,2,3,90,-90,0\n",
      "omega_deg,phi_deg,kappa_deg\nframe0/0.jpg,1,2,3,0,0,-90\n"};
  for (const std::string& table : tables) {
    write_file(folder.path("p.csv"), "image,x_m,y_m,z_m," + table);
    Block block = small_result().block;
    std::vector<std::string> warnings;
    set_given_poses(read_approximate_poses(folder.path("p.csv")), {}, block, warnings);
    const Eigen::Quaterniond& rotation = block.frames[FrameIndex(0)].given_pose->rotation;
    EXPECT_LT((rotation * Eigen::Vector3d::UnitX() - Eigen::Vector3d(0, -1, 0)).norm(), 1e-12) << table;
    EXPECT_LT((rotation * Eigen::Vector3d::UnitZ() - Eigen::Vector3d(0, 0, -1)).norm(), 1e-12) << table;
  }
}

TEST(ApproximatePoses, Refusals) {
  ScratchDirectory folder;
  Block block = small_result().block;
  const auto refusal = [&](const std::string& text) {
    write_file(folder.path("p.csv"), text);
    std::vector<std::string> warnings;
    return message_of<InputError>([&] {
      const ApproximatePoses poses = read_approximate_poses(folder.path("p.csv"));
      set_given_poses(poses, {}, block, warnings);
    });
  };
  const std::string local = "image,x_m,y_m,z_m,omega_deg,phi_deg,kappa_deg\n";
  EXPECT_EQ(refusal(local + "frame0/0.jpg,1,2,3,0,0,0\n"), "");
  EXPECT_THAT(refusal("image,x_m,y_m,z_m\n"), HasSubstr("p.csv:1: column 'yaw_deg' is missing"));
  EXPECT_THAT(refusal("image,latitude_deg,longitude_deg,omega_deg\n"), HasSubstr("column 'height_m' is missing"));
  EXPECT_THAT(refusal("x_m,y_m,z_m\n"), HasSubstr("column 'name' is missing"));
  EXPECT_THAT(refusal(local + "frame0/0.jpg,1,two,3,0,0,0\n"), HasSubstr("p.csv:2: y_m: 'two' is not a number"));
  EXPECT_THAT(refusal(local + "frame0/0.jpg,1,,3,0,0,0\n"), HasSubstr("p.csv:2: y_m is empty"));
  EXPECT_THAT(refusal(local + "frame0/0.jpg,1,NaN,3,0,0,0\n"), HasSubstr("p.csv:2: y_m: 'NaN' is not a finite number"));
  EXPECT_THAT(refusal(local + "frame0/0.jpg,1,-inf,3,0,0,0\n"), HasSubstr("y_m: '-inf' is not a finite number"));
  const std::string remedy = " is beyond any place on Earth; correct the number or its unit, or take the line out";
  EXPECT_THAT(refusal(local + "frame0/0.jpg,1,2,1e300,0,0,0\n"), HasSubstr("p.csv:2: z_m: 1e+300" + remedy));
  EXPECT_THAT(refusal(local + "frame0/0.jpg,-1.1e8,2,3,0,0,0\n"), HasSubstr("p.csv:2: x_m: -1.1e+08" + remedy));
  EXPECT_EQ(refusal(local + "frame0/0.jpg,32500000,5500000,3,0,0,0\n"), "");
  EXPECT_THAT(refusal("name,qw,qx,qy,qz,x,y,z\nframe0/0.jpg,1,0,0,0,1,2e8,3\n"),
              HasSubstr("p.csv:2: y: 2e+08" + remedy));
  EXPECT_THAT(refusal(local + "none.jpg,1,2,3,0,0,0\n"),
              HasSubstr("p.csv:2: the block has no image and no frame 'none.jpg'"));
  EXPECT_THAT(refusal(local + "frame0/0.jpg,1,2,3,0,0,0\nframe0/0.jpg,1,2,3,0,0,0\n"), HasSubstr("appears twice"));
  EXPECT_THAT(refusal("image,x_m,y_m,z_m,yaw_deg,pitch_deg,roll_deg\nframe0/0.jpg,1,2,3,0,-85,0\n"),
              HasSubstr("p.csv:2: pitch_deg is near -90, as in the angles of a gimbal"));
  EXPECT_THAT(
      refusal("image,latitude_deg,longitude_deg,height_m,yaw_deg,pitch_deg,roll_deg\nframe0/0.jpg,97,1,1,0,0,0\n"),
      HasSubstr("p.csv:2"));
}

}  // namespace
}  // namespace megablock
