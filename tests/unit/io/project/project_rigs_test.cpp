#include <gmock/gmock.h>

#include "io/base/error.h"
#include "io/project/project.h"
#include "tests/support/io/image_files.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

using fixture::gps_tags;
using fixture::message_of;
using fixture::write_file;
using fixture::write_image_file;
using ::testing::HasSubstr;

const char* const kCameras = R"({"right": {"rotation": [0, 1.5707963267948966, 0], "translation": [0.1, 0, 0.2]},
                                  "left": {"rotation": [0, 0, 0], "translation": [0, 0, 0]},
                                  "unused": {"rotation": [0, 0, 0], "translation": [1, 0, 0]}})";
const char* const kAssignments = R"([[["left/1.jpg", "left"], ["right/1.jpg", "right"]],
                                      [["left/2.jpg", "left"], ["right/2.jpg", "right"]]])";

class ProjectRigs : public ::testing::Test {
 protected:
  ProjectRigs() {
    int shade = 0;
    for (const std::string camera : {"left", "right"})
      for (const std::string number : {"1", "2", "3"}) {
        ++shade;
        write_image_file(folder_.path("images/" + camera + "/" + number + ".jpg"), camera == "left" ? 64 : 80, 48,
                         shade, gps_tags(52.52, 13.4 + 0.001 * shade, 40));
      }
  }

  Project read(const std::string& cameras, const std::string& assignments, const std::string& more = "") {
    write_file(folder_.path("rig_cameras.json"), cameras);
    write_file(folder_.path("rig_assignments.json"), assignments);
    write_file(folder_.path("block.yaml"),
               "images: images\ncameras: {grouping: folder}\n"
               "rigs:\n  cameras: rig_cameras.json\n  assignments: rig_assignments.json\n" +
                   more);
    return read_project(folder_.path("block.yaml"));
  }
  std::string refusal(const std::string& cameras, const std::string& assignments, const std::string& more = "") {
    return message_of<InputError>([&] { read(cameras, assignments, more); });
  }

  ScratchDirectory folder_;
};

TEST_F(ProjectRigs, JoinImagesOfAnExposure) {
  const Block block = read(kCameras, kAssignments).block;
  EXPECT_NO_THROW(check(block));
  ASSERT_EQ(block.images.size(), 6u);
  ASSERT_EQ(block.frames.size(), 4u) << "two exposures and two single images";
  const auto image = [&](const std::string& name) {
    for (std::size_t i = 0; i < block.images.size(); ++i)
      if (block.name_of(ImageIndex(static_cast<std::int64_t>(i))) == name)
        return ImageIndex(static_cast<std::int64_t>(i));
    return ImageIndex();
  };
  const Image &left = block.images[image("left/1.jpg")], &right = block.images[image("right/1.jpg")];
  EXPECT_EQ(left.frame, right.frame);
  EXPECT_NE(left.frame, block.images[image("left/2.jpg")].frame);
  EXPECT_EQ(block.frames[left.frame].name, "left/1.jpg");
  EXPECT_EQ(block.cameras[block.camera_of(image("right/2.jpg"))].name, "right 80x48");
  // The file's order gives the mounts; "right" is the reference. X_cam = R X_rig + t turns the rig's z into x.
  const Rig& rig = block.rig_of(left.frame);
  ASSERT_EQ(rig.mounts.size(), 2u);
  EXPECT_TRUE(rig.mounts[0].held());
  EXPECT_FALSE(rig.mounts[1].held());
  const Mount& mount = block.mount_of(image("right/1.jpg"));
  const Eigen::Vector3d point(1, 2, 3);
  EXPECT_LT((to_inside(mount.pose, point) - (Eigen::Vector3d(3, 2, -1) + Eigen::Vector3d(0.1, 0, 0.2))).norm(), 1e-12);
  EXPECT_EQ(block.rig_of(block.images[image("right/3.jpg")].frame).mounts.size(), 1u);
  EXPECT_TRUE(block.frames[left.frame].position_prior);
  // One prior per frame, of its first image.
  const double east = block.frames[left.frame].position_prior->position.x();
  EXPECT_NEAR(block.frames[block.images[image("left/2.jpg")].frame].position_prior->position.x() - east, 67.8, 0.5);
}

TEST_F(ProjectRigs, NamedExposuresAndHeldMounts) {
  const Block block = read(kCameras, R"({"first": [["left/1.jpg", "left"], ["right/1.jpg", "right"]]})",
                           "  sigma_position_m: 0\n  sigma_rotation_deg: 0\n")
                          .block;
  EXPECT_EQ(block.frames[block.images[ImageIndex(0)].frame].name, "first");
  EXPECT_TRUE(block.rigs[RigIndex(0)].mounts[1].held());
}

// Cameras fail, disks fill: frames do with the images that are there, and what refers to the others is no error.
TEST_F(ProjectRigs, MissingImagesAreToldAndDoneWithout) {
  write_file(folder_.path("poses.csv"),
             "name,qw,qx,qy,qz,x,y,z,pass\nfirst,1,0,0,0,1,2,3,7\ngone,1,0,0,0,1,2,3,7\nleft/9.jpg,1,0,0,0,1,2,3,7\n");
  const Project project = read(kCameras,
                               R"({"first": [["left/1.jpg", "left"], ["right/9.jpg", "right"]],
               "second": [["left/2.jpg", "left"], ["right/2.jpg", "right"]],
               "gone": [["left/9.jpg", "left"]]})",
                               "poses: poses.csv\norigin: [52.52, 13.4, 40]\n");
  EXPECT_NO_THROW(check(project.block));
  const auto frame = [&](const std::string& name) -> const Frame* {
    for (const Frame& f : project.block.frames)
      if (f.name == name) return &f;
    return nullptr;
  };
  ASSERT_TRUE(frame("first") && frame("second"));
  EXPECT_FALSE(frame("gone"));
  EXPECT_EQ(frame("first")->pass, 7);
  EXPECT_TRUE(frame("first")->given_pose);
  EXPECT_EQ(project.block.images.size(), 6u);
  ASSERT_EQ(project.warnings.size(), 3u);
  EXPECT_THAT(project.warnings[0], HasSubstr("rig_assignments.json: 2 of 5 images are not in the folder of images, "
                                             "'right/9.jpg' for example"));
  EXPECT_THAT(project.warnings[1], HasSubstr("the pose of 'gone' is not used, because 'gone' was left out"));
  EXPECT_THAT(project.warnings[2], HasSubstr("the pose of 'left/9.jpg' is not used"));
}

TEST_F(ProjectRigs, Refusals) {
  EXPECT_THAT(refusal("{", kAssignments), HasSubstr("rig_cameras.json: not valid JSON"));
  EXPECT_THAT(refusal("[]", kAssignments), HasSubstr("expected an object of rig cameras"));
  EXPECT_THAT(refusal(R"({"left": {"rotation": [0, 0]}})", kAssignments), HasSubstr("'rotation' must be a list of 3"));
  EXPECT_THAT(refusal(R"({"left": {"rotation": [0, 0, 0], "translation": [0, 1e300, 0]}})", kAssignments),
              HasSubstr("rig camera 'left': translation: [0, 1e+300, 0] m is no place on a vehicle"));
  EXPECT_THAT(refusal(R"({"left": {"rotation": [0, 90, 0], "translation": [0, 0, 0]}})", kAssignments),
              HasSubstr("rig camera 'left': rotation: [0, 90, 0] is more than a full turn"));
  EXPECT_THAT(refusal(kCameras, "[[1]]"), HasSubstr("exposure 1 must be a list of [image, rig camera]"));
  EXPECT_THAT(refusal(kCameras, R"([[["left/1.jpg", "top"]]])"), HasSubstr("rig camera 'top', which"));
  EXPECT_THAT(refusal(kCameras, R"([[["left/9.jpg", "left"]]])"),
              HasSubstr("no image of the block is assigned; 'left/9.jpg', for example, is not in the folder"));
  EXPECT_THAT(refusal(kCameras, R"([[["left/1.jpg", "left"]], [["left/1.jpg", "left"]]])"),
              HasSubstr("assigned twice"));
  EXPECT_THAT(refusal(kCameras, R"([[["left/1.jpg", "left"]], [["right/1.jpg", "left"]]])"),
              HasSubstr("has images of two cameras"));
  EXPECT_THAT(refusal(kCameras, kAssignments, "  sigma_position_m: 0\n"), HasSubstr("both be positive, or both 0"));
  write_file(folder_.path("block.yaml"), "images: images\nrigs: {cameras: rig_cameras.json}\n");
  EXPECT_THAT(message_of<InputError>([&] { read_project(folder_.path("block.yaml")); }),
              HasSubstr("block.yaml:2: rigs needs 'cameras' and 'assignments'"));
}

}  // namespace
}  // namespace megablock
