#include "io/project/project.h"

#include <gmock/gmock.h>

#include "geometry/numbers/angles.h"
#include "io/base/error.h"
#include "io/base/hash.h"
#include "io/block/crs.h"
#include "io/block/held_priors.h"
#include "io/project/inputs/pose_csv.h"
#include "io/simulate/blocks/simulate.h"
#include "io/simulate/files/write.h"
#include "io/store/units/block_file.h"
#include "io/text/csv_table.h"
#include "io/text/yaml_reader.h"
#include "tests/support/io/image_files.h"
#include "tests/support/io/image_names.h"
#include "tests/support/io/project_text.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

using fixture::gps_tags;
using fixture::joined;
using fixture::kDji;
using fixture::message_of;
using fixture::read_file;
using fixture::read_text;
using fixture::refusal;
using fixture::Tags;
using fixture::write_file;
using fixture::write_image_file;
using fixture::write_line;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

FrameIndex frame(std::int64_t i) { return FrameIndex(i); }

TEST(Project, ScansImagesInByteOrderAndGroupsThem) {
  ScratchDirectory folder;
  write_image_file(folder.path("images/b/2.JPG"), 64, 48, 1, kDji);
  write_image_file(folder.path("images/B.jpeg"), 64, 48, 2, kDji);
  write_image_file(folder.path("images/a.png"), 64, 48, 3);
  write_image_file(folder.path("images/b/10.jpg"), 32, 48, 4, kDji);
  write_file(folder.path("images/readme.txt"), "no image");
  const Project project = read_text(folder, "images: images\n");
  EXPECT_THAT(image_names(project.block), ElementsAre("B.jpeg", "a.png", "b/10.jpg", "b/2.JPG"));
  EXPECT_EQ(project.block.path_of(ImageIndex(3)), folder.path("images/b/2.JPG"));
  EXPECT_EQ(project.block.images[ImageIndex(3)].file_hash, hash_file(folder.path("images/b/2.JPG")));
  ASSERT_THAT(project.block.cameras, SizeIs(3));
  const Camera& dji = project.block.cameras[CameraIndex(0)];
  EXPECT_EQ(dji.name, "DJI FC300S 64x48 3.61mm");
  EXPECT_TRUE(dji.focal_known);
  EXPECT_DOUBLE_EQ(dji.intrinsics[kFocal], 3.61 / 6.17 * 64);
  EXPECT_DOUBLE_EQ(dji.intrinsics[kPrincipalX], 32);
  EXPECT_DOUBLE_EQ(dji.prior_sigma[kFocal], 0.05 * dji.intrinsics[kFocal]);
  const Camera& unknown = project.block.cameras[CameraIndex(1)];
  EXPECT_EQ(unknown.name, "unknown 64x48");
  EXPECT_FALSE(unknown.focal_known);
  EXPECT_DOUBLE_EQ(unknown.intrinsics[kFocal], 1.2 * 64);
  EXPECT_EQ(project.block.camera_of(ImageIndex(3)), CameraIndex(0));
  EXPECT_EQ(project.block.camera_of(ImageIndex(2)), CameraIndex(2));
  EXPECT_FALSE(project.block.ground.georeferenced);
  EXPECT_THAT(read_text(folder, "images: images\ncameras: {grouping: one}\n").block.cameras, SizeIs(2));
  const Project by_folder = read_text(folder, "images: images\ncameras: {grouping: folder}\n");
  EXPECT_THAT(by_folder.block.cameras, SizeIs(3));
  EXPECT_EQ(by_folder.block.cameras[CameraIndex(1)].name, "b 32x48");
}

TEST(Project, GpsBecomesPositionPriorsAboutTheRoundedMedian) {
  ScratchDirectory folder;
  write_line(folder);
  const Block block = read_text(folder, "images: images\n").block;
  EXPECT_TRUE(block.ground.georeferenced);
  EXPECT_DOUBLE_EQ(block.ground.latitude_deg, 46.84);
  EXPECT_DOUBLE_EQ(block.ground.longitude_deg, -91.988);
  EXPECT_DOUBLE_EQ(block.ground.height_m, 250);
  const PositionPrior& prior = *block.frames[frame(4)].position_prior;
  EXPECT_NEAR(prior.position.x(), 2 * 76.25, 0.1);
  EXPECT_NEAR(prior.position.z(), 0, 0.01);
  EXPECT_EQ(prior.sigma, Eigen::Vector3d(3, 3, 6));
  EXPECT_FALSE(block.frames[frame(4)].attitude_prior);
}

TEST(Project, GpsOptionsAndOriginOverride) {
  ScratchDirectory folder;
  write_line(folder);
  const Block block = read_text(folder,
                                "images: images\norigin: [46.8, -91.9, 100]\n"
                                "gps: {sigma_horizontal_m: 0.5, sigma_vertical_m: 1, lever_arm_m: [0, 0.1, -0.2]}\n")
                          .block;
  EXPECT_EQ(block.ground.latitude_deg, 46.8);
  const PositionPrior& prior = *block.frames[frame(0)].position_prior;
  EXPECT_EQ(prior.sigma, Eigen::Vector3d(0.5, 0.5, 1));
  EXPECT_EQ(prior.lever_arm, Eigen::Vector3d(0, 0.1, -0.2));
  EXPECT_NEAR(prior.position.z(), 150 - 5.24, 0.05) << "150 m up, minus the curvature over 8.2 km (d^2 / 2R)";
  for (const Frame& f : read_text(folder, "images: images\ngps: {use: false}\n").block.frames)
    EXPECT_FALSE(f.position_prior);
  for (const Frame& f :
       read_text(folder, "images: images\ngps: {sigma_horizontal_m: 0, sigma_vertical_m: 0}\n").block.frames)
    EXPECT_TRUE(held(*f.position_prior));
  // A running job's ground frame wins over both.
  const GroundFrame running{true, 46.9, -92, 0, "EPSG:4979"};
  EXPECT_EQ(read_project(folder.path("block.yaml"), {}, running).block.ground.latitude_deg, 46.9);
}

TEST(Project, AccuracyInTheHeaderGivesTheSigmas) {
  ScratchDirectory folder;
  // The images lie apart: equal positions would count as one.
  const auto gps = [](int i) { return gps_tags(46.84, -91.99 + 0.001 * i, 250); };
  write_image_file(folder.path("images/0_dop.jpg"), 64, 48, 0, joined(gps(0), {{"Exif.GPSInfo.GPSDOP", "10/1"}}));
  write_image_file(folder.path("images/1_good_dop.jpg"), 64, 48, 1, joined(gps(1), {{"Exif.GPSInfo.GPSDOP", "9/10"}}));
  write_image_file(folder.path("images/2_rtk.jpg"), 64, 48, 2,
                   joined(gps(2), {{"Xmp.drone-dji.RtkStdLon", "0.01"},
                                   {"Xmp.drone-dji.RtkStdLat", "0.02"},
                                   {"Xmp.drone-dji.RtkStdHgt", "0.03"}}));
  Tags flat = gps(3);
  flat.erase("Exif.GPSInfo.GPSAltitude");
  write_image_file(folder.path("images/3_flat.jpg"), 64, 48, 3, flat);
  const Block block = read_text(folder, "images: images\n").block;
  EXPECT_EQ(block.frames[frame(0)].position_prior->sigma, Eigen::Vector3d(10, 10, 20));
  EXPECT_EQ(block.frames[frame(1)].position_prior->sigma, Eigen::Vector3d(3, 3, 6));
  EXPECT_EQ(block.frames[frame(2)].position_prior->sigma, Eigen::Vector3d(0.02, 0.02, 0.03));
  EXPECT_EQ(block.frames[frame(3)].position_prior->sigma, Eigen::Vector3d(3, 3, 1000));
  EXPECT_NEAR(block.frames[frame(3)].position_prior->position.z(), 0, 1e-3);
}

TEST(Project, WrongPositionsAreDroppedAndNamed) {
  ScratchDirectory folder;
  write_line(folder, 8);
  write_image_file(folder.path("images/far.jpg"), 64, 48, 100, gps_tags(46.93, -91.99, 250));
  write_image_file(folder.path("images/null.jpg"), 64, 48, 101, gps_tags(0, 0, 0));
  write_image_file(folder.path("images/swapped.jpg"), 64, 48, 102, gps_tags(-91.99, 46.84, 250));
  write_image_file(folder.path("images/high.jpg"), 64, 48, 103, gps_tags(46.84, -91.99, 9000));
  const Project project = read_text(folder, "images: images\n");
  for (const Frame& f : project.block.frames) {
    const bool wrong = f.name == "far.jpg" || f.name == "null.jpg" || f.name == "swapped.jpg";
    EXPECT_EQ(f.position_prior.has_value(), !wrong) << f.name;
    if (f.name == "high.jpg") {
      EXPECT_EQ(f.position_prior->sigma.z(), 1000);
    }
  }
  ASSERT_THAT(project.warnings, SizeIs(4));
  EXPECT_THAT(project.warnings,
              ::testing::UnorderedElementsAre(AllOf(HasSubstr("'far.jpg'"), HasSubstr("10.0 km from the others")),
                                              AllOf(HasSubstr("'null.jpg'"), HasSubstr("0, 0")),
                                              AllOf(HasSubstr("'swapped.jpg'"), HasSubstr("swapped")),
                                              AllOf(HasSubstr("'high.jpg'"), HasSubstr("height"))));
}

TEST(Project, SwappedPositionsInsideTheRangesAreTold) {
  ScratchDirectory folder;
  for (int i = 0; i < 5; ++i)
    write_image_file(folder.path("images/" + std::to_string(i) + ".jpg"), 64, 48, i,
                     gps_tags(52.5, 13.4 + 0.001 * i, 30));
  write_image_file(folder.path("images/s.jpg"), 64, 48, 9, gps_tags(13.4, 52.5, 30));
  EXPECT_THAT(read_text(folder, "images: images\n").warnings, ElementsAre(HasSubstr("look swapped")));
}

TEST(Project, GimbalAnglesBecomeAttitudesInTheBlock) {
  ScratchDirectory folder;
  const Tags nadir = {{"Xmp.drone-dji.GimbalYawDegree", "90"},
                      {"Xmp.drone-dji.GimbalPitchDegree", "-90"},
                      {"Xmp.drone-dji.GimbalRollDegree", "0"}};
  write_image_file(folder.path("images/0.jpg"), 64, 48, 0, joined(nadir, gps_tags(46.84, -91.99, 250)));
  write_image_file(folder.path("images/1.jpg"), 64, 48, 1, joined(nadir, gps_tags(46.93, -91.99, 250)));
  const Block block = read_text(folder, "images: images\norigin: [46.84, -91.99, 250]\n").block;
  const AttitudePrior& near = *block.frames[frame(0)].attitude_prior;
  // Nadir with the top of the image to the east: camera x points south, y (down the image) west, z down.
  const Eigen::Matrix3d expected = (Eigen::Matrix3d() << 0, -1, 0, -1, 0, 0, 0, 0, -1).finished();
  EXPECT_LT((near.rotation_cw.toRotationMatrix() - expected).norm(), 1e-9);
  EXPECT_LT((near.sigma_rad / kDegree - Eigen::Vector3d(3, 3, 10)).norm(), 1e-6) << "heading is about the axis";
  // 10 km north the own vertical leans 0.09 degrees to the north.
  const AttitudePrior& far = *block.frames[frame(1)].attitude_prior;
  EXPECT_NEAR(rotation_angle(near.rotation_cw, far.rotation_cw) / kDegree, 0.09, 1e-4);
  const Eigen::Vector3d down = far.rotation_cw.conjugate() * Eigen::Vector3d::UnitZ();
  EXPECT_NEAR(down.y(), -std::sin(0.09 * kDegree), 1e-7);
  for (const Frame& f : read_text(folder, "images: images\nattitude: {use: false}\n").block.frames)
    EXPECT_FALSE(f.attitude_prior);
  EXPECT_NEAR(read_text(folder, "images: images\nattitude: {sigma_deg: 1}\n")
                  .block.frames[frame(0)]
                  .attitude_prior->sigma_rad.z(),
              1 * kDegree, 1e-9);
  for (const Frame& f : read_text(folder, "images: images\nattitude: {sigma_deg: 0}\n").block.frames)
    EXPECT_TRUE(held(*f.attitude_prior));
}

// What systems and other programs leave in folders of images (shared/data/hard, leftovers).
TEST(Project, LeftoversOfOtherProgramsAreNoImages) {
  ScratchDirectory folder;
  write_line(folder, 2);
  for (const char* name : {"._0.jpg", "._1.jpg", "Thumbs.db", ".DS_Store", "0.jpg_original", "desktop.ini"})
    write_file(folder.path(std::string("images/") + name), std::string("\0\5\x16\7\0\2\0\0Mac OS X        ", 24));
  for (const char* name : {"@eaDir/0.jpg/SYNOPHOTO_THUMB_XL.jpg", "__MACOSX/images/._0.jpg", ".thumbnails/0.jpg"})
    write_image_file(folder.path(std::string("images/") + name), 16, 12, 7);
  const Project project = read_text(folder, "images: images\n");
  EXPECT_THAT(image_names(project.block), ElementsAre("0.jpg", "1.jpg"));
  EXPECT_THAT(project.unreadable, IsEmpty());
  EXPECT_THAT(project.warnings, IsEmpty());
}

TEST(Project, BadFilesAndCopiesAreLeftOut) {
  ScratchDirectory folder;
  write_line(folder, 2);
  write_file(folder.path("images/empty.jpg"), "");
  write_file(folder.path("images/text.jpg"), "only words");
  write_file(folder.path("images/9_copy.jpg"), read_file(folder.path("images/1.jpg")));
  const Project project = read_text(folder, "images: images\n");
  EXPECT_THAT(project.block.images, SizeIs(2));
  ASSERT_THAT(project.unreadable, SizeIs(2));
  EXPECT_EQ(project.unreadable[0].first, "empty.jpg");
  EXPECT_EQ(project.unreadable[1].first, "text.jpg");
  EXPECT_THAT(project.warnings, ElementsAre("image '9_copy.jpg' is a copy of '1.jpg'; left out"));
}

TEST(Project, StageSectionsKeepFileAndLine) {
  ScratchDirectory folder;
  write_line(folder, 1);
  const Project project =
      read_text(folder, "images: images\nfeatures:\n  max_features: 4000\nmatching: {ratio: 0.7}\n");
  ASSERT_THAT(project.settings.entries, SizeIs(2));
  const auto& entry = project.settings.entries[0];
  EXPECT_EQ(entry.section + "." + entry.key + "=" + entry.value, "features.max_features=4000");
  EXPECT_EQ(entry.where, folder.path("block.yaml") + std::string(":3"));
  EXPECT_EQ(project.settings.entries[1].where, folder.path("block.yaml") + std::string(":4"));
  write_file(folder.path("filter.yaml"), "");
  EXPECT_EQ(read_text(folder, "images: images\nmatching: {filter_model: filter.yaml}\n").settings.entries[0].value,
            folder.path("filter.yaml"));
  EXPECT_THAT(refusal(folder, "images: images\nmaching: {ratio: 0.7}\n"), HasSubstr("did you mean 'matching'?"));
}

// A lever arm or boresight with a sigma is an unknown: the rig gets a receiver.
TEST(Project, FreesLeverArmsAndBoresights) {
  ScratchDirectory folder;
  write_line(folder, 3);
  const auto rig = [&](const std::string& text) {
    return read_text(folder, "images: images\n" + text).block.rigs[RigIndex(0)];
  };
  EXPECT_FALSE(rig("gps: {lever_arm_sigma_m: 0}\n").has_receiver());
  const Rig arm = rig("gps: {lever_arm_sigma_m: 0.25}\n");
  ASSERT_TRUE(arm.has_receiver());
  EXPECT_EQ(arm.cameras().size(), 1u);
  EXPECT_EQ(arm.mounts.back().position_sigma_m, 0.25);
  EXPECT_EQ(arm.mounts.back().rotation_sigma_rad, 0);
  EXPECT_THAT(refusal(folder, "images: images\ngps: {lever_arm_sigma_m: -1}\n"), HasSubstr("lever_arm_sigma_m"));
  EXPECT_THAT(refusal(folder, "images: images\nattitude: {boresight_deg: [1, 2]}\n"),
              HasSubstr("must be a list of 3 numbers"));
  EXPECT_THAT(refusal(folder, "images: images\nattitude: {boresight_sigma_deg: 1e9}\n"),
              HasSubstr("boresight_sigma_deg"));
}

// Positions of images that match a pattern have a shift in common.
TEST(Project, GroupsPositions) {
  ScratchDirectory folder;
  write_line(folder, 3);
  const Block block =
      read_text(folder, "images: images\ngps: {groups: ['*1*', '*'], group_sigma_m: 5}\n").block;
  ASSERT_EQ(block.rigs.size(), 3u);
  for (RigIndex rig(1); block.rigs.contains(rig); ++rig.value) {
    EXPECT_TRUE(block.rigs[rig].is_group());
    EXPECT_EQ(block.rigs[rig].mounts.front().position_sigma_m, 5);
  }
  for (ImageIndex i(0); block.images.contains(i); ++i.value) {
    const PositionPrior& prior = *block.frames[block.images[i].frame].position_prior;
    EXPECT_EQ(prior.group, RigIndex(block.name_of(i).find('1') != std::string::npos ? 1 : 2)) << block.name_of(i);
    EXPECT_EQ(prior.shifted.cast<int>().sum(), 3);
  }
  EXPECT_NO_THROW(check(block));
  EXPECT_THAT(refusal(folder, "images: images\ngps: {groups: ['flight2/*']}\n"),
              HasSubstr("no image with a position matches 'flight2/*'"));
  EXPECT_THAT(refusal(folder, "images: images\ngps: {groups: ['*', '*1*']}\n"), HasSubstr("matches '*1*'"));
  EXPECT_THAT(refusal(folder, "images: images\ngps: {groups: ['*'], group_sigma_m: 0}\n"), HasSubstr("group_sigma_m"));
}

// For the report's list of options: as they were written.
TEST(Project, KeepsWhatIsSaidOfPositionsAndAttitudes) {
  ScratchDirectory folder;
  write_line(folder, 1);
  const Project project = read_text(
      folder, "images: images\ngps: {sigma_horizontal_m: 1.50, lever_arm_m: [0, 0.1, -0.2]}\nattitude: {use: false}\n");
  std::vector<std::string> said;
  for (const auto& entry : project.settings.entries)
    said.push_back(entry.section + "." + entry.key + "=" + entry.value);
  EXPECT_THAT(said, ElementsAre("gps.sigma_horizontal_m=1.50", "gps.lever_arm_m=[0, 0.1, -0.2]", "attitude.use=false"));
}

TEST(Project, WarnsOfSectionsThatActOnNothing) {
  ScratchDirectory folder;
  write_image_file(folder.path("images/a.jpg"), 64, 48, 1);
  EXPECT_THAT(
      read_text(folder, "images: images\ngps: {sigma_horizontal_m: 1}\nattitude: {sigma_deg: 1}\n").warnings,
      testing::AllOf(
          testing::Contains(testing::EndsWith("block.yaml:2: 'gps' has no effect: the images have no positions")),
          testing::Contains(
              testing::EndsWith("block.yaml:3: 'attitude' has no effect: the images have no attitudes"))));
}

// Far-off start values end in a block that seems to have no datum: said before.
TEST(Project, WarnsOfPosesFarFromThePositions) {
  ScratchDirectory folder;
  Project project;
  Block& block = project.block;
  block = simulate_block(SimulationOptions{.frames = 30}).block;
  check_distant_places({}, project);
  EXPECT_THAT(project.warnings, IsEmpty());
  const auto move = [&](double metres) {
    for (Frame& frame : block.frames) {
      if (!frame.given_pose) frame.given_pose = Pose{{1, 0, 0, 0}, frame.position_prior->position};
      frame.given_pose->centre.y() += metres;
    }
    project.warnings.clear();
    check_distant_places({}, project);
  };
  move(200);  // drift of an inertial system
  EXPECT_THAT(project.warnings, IsEmpty());
  move(800);
  EXPECT_THAT(project.warnings, ElementsAre(testing::ContainsRegex(
                                    "^given poses lie 1000 m \\(median\\) from the positions of the same 30 "
                                    "frames, .*correct the poses")));
  for (Frame& frame : block.frames) frame.position_prior->sigma.setConstant(100);  // as good as these are
  move(0);
  EXPECT_THAT(project.warnings, IsEmpty());
}

TEST(Project, RefusalsNameFileAndLine) {
  ScratchDirectory folder;
  write_line(folder, 2);
  std::filesystem::create_directories(folder.path("nothing"));
  const std::string images = "images: images\n";
  EXPECT_THAT(refusal(folder, "imagse: images\n"), HasSubstr("block.yaml:1: "));
  EXPECT_THAT(refusal(folder, "# a comment\nimges: images\n"),
              HasSubstr("block.yaml:2: unknown key 'imges'; did you mean 'images'?"));
  EXPECT_THAT(refusal(folder, images + "# a comment\nimges: images\n"),
              HasSubstr("block.yaml:3: unknown key 'imges'; did you mean 'images'? known keys: "));
  EXPECT_EQ(refusal(folder, "\nimages: flight\n"), "block.yaml:2: images: folder 'flight' does not exist");
  EXPECT_THAT(refusal(folder, "images: nothing\n"), HasSubstr("block.yaml:1: images: no readable image"));
  EXPECT_THAT(refusal(folder, images + "gps:\n  sigma_horizontal_m: 3 m\n"),
              HasSubstr("block.yaml:3: gps.sigma_horizontal_m: '3 m' has text after the number"));
  EXPECT_THAT(
      refusal(folder, images + "gps: {sigma_vertical_m: -1}\n"),
      HasSubstr(
          "block.yaml:2: sigma_vertical_m must lie in [1e-08, 1e+06], or be 0 to hold the observed value, not -1"));
  for (const char* absurd : {"1e300", "1e-300"}) {
    const auto refused = [&](const std::string& text, const std::string& key) {
      const std::string value = absurd;
      EXPECT_THAT(refusal(folder, images + text + value + "}\n"),
                  ::testing::AllOf(HasSubstr("block.yaml:"), HasSubstr(key + " must lie in ["), HasSubstr(", not 1e")));
    };
    refused("gps: {sigma_horizontal_m: ", "sigma_horizontal_m");
    refused("attitude: {sigma_deg: ", "sigma_deg");
    refused("cameras:\n  default: {focal_px: ", "cameras.default.focal_px");
  }
  EXPECT_THAT(refusal(folder, images + "gps: {sigma_horizontal_cm: 3}\n"),
              HasSubstr("unknown key 'sigma_horizontal_cm' in 'gps'; did you mean 'sigma_horizontal_m'?"));
  EXPECT_THAT(refusal(folder, images + "gps: 3\n"), HasSubstr("block.yaml:2: 'gps' must be a mapping"));
  EXPECT_THAT(refusal(folder, images + "gps: {lever_arm_m: [1, 2]}\n"), HasSubstr("must be a list of 3 numbers"));
  EXPECT_THAT(refusal(folder, images + "gps: {lever_arm_m: [0, 0, 1e300]}\n"),
              HasSubstr("block.yaml:2: gps.lever_arm_m: [0, 0, 1e+300] m is no place on a vehicle"));
  EXPECT_THAT(refusal(folder, images + "gps: {use: maybe}\n"), HasSubstr("neither true nor false"));
  EXPECT_THAT(refusal(folder, images + "origin: [146, 3, 0]\n"), HasSubstr("block.yaml:2: origin must be"));
  EXPECT_THAT(refusal(folder, images + "origin: [46, 3, 1e300]\n"),
              HasSubstr("block.yaml:2: origin: 1e+300 is beyond"));
  EXPECT_THAT(refusal(folder, images + "images: images\n"), HasSubstr("block.yaml:2: key 'images' appears twice"));
  EXPECT_THAT(refusal(folder, images + "cameras: {grouping: colour}\n"), HasSubstr("not one of: exif, folder, one"));
  EXPECT_THAT(refusal(folder, images + "cameras: {Nikon: {focal_px: 3}}\n"),
              HasSubstr("block.yaml:2: cameras: no camera is named 'Nikon'; the cameras are 'DJI FC300S"));
  EXPECT_THAT(refusal(folder, images + "cameras: {default: {focal_mm: 3}}\n"), HasSubstr("focal_mm needs sensor_mm"));
  EXPECT_THAT(refusal(folder, images + "cameras: {default: {focal_px: 3, focal_mm: 3, sensor_mm: 2}}\n"),
              HasSubstr("not both"));
  EXPECT_THAT(refusal(folder, images + "cameras: {default: {calibrate: [k9]}}\n"),
              HasSubstr("'k9' is not a parameter of camera 'DJI FC300S 64x48 3.61mm' (model brown)"));
  EXPECT_THAT(refusal(folder, images + "cameras: {default: {mask: none.png}}\n"), HasSubstr("does not exist"));
  EXPECT_THAT(refusal(folder, images + "features: {max_features: [1, 2]}\n"), HasSubstr("must be one plain value"));
  EXPECT_THAT(refusal(folder, images + "features:\n  max_features:\n"), HasSubstr("block.yaml:3: "));
  EXPECT_THAT(refusal(folder, images + "gps: {use: true\n"), HasSubstr("not valid YAML"));
  EXPECT_THAT(refusal(folder, images + "tie_points: none.h5\n"), HasSubstr("file 'none.h5' does not exist"));
  EXPECT_THAT(refusal(folder, ""), HasSubstr("key 'images'"));
  EXPECT_THAT(refusal(folder, "just words"), HasSubstr("must be a mapping"));
  EXPECT_THAT(message_of<InputError>([&] { read_project(folder.path("missing.yaml")); }), HasSubstr("cannot be read"));
  EXPECT_THAT(message_of<InputError>([&] { read_project(folder.path()); }), HasSubstr("cannot be read"));
}

class GivenBlock : public ::testing::Test {
 protected:
  GivenBlock() {
    SimulationOptions options = SimulationOptions::of(SimulationOptions::Scene::kAerial);
    options.frames = 6;
    options.start_position_error_m = options.start_rotation_error_deg = 1;
    write_simulated_block(options, folder_.path());
  }
  std::string refusal_of(const std::string& line) {
    return refusal(folder_, "block: given.h5\ntie_points: tie_points.h5\n" + line);
  }
  ScratchDirectory folder_;
};

TEST_F(GivenBlock, PosesTakeThePlaceOfItsOwn) {
  const Block given = read_block(folder_.path("given.h5"));
  PoseTable poses;
  poses.names = {given.frames[frame(2)].name};
  poses.poses = {Pose{Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitX())), {1, 2, 3}}};
  write_pose_csv(folder_.path("poses.csv"), poses);
  const Block block = read_text(folder_, "block: given.h5\ntie_points: tie_points.h5\nposes: poses.csv\n").block;
  ASSERT_TRUE(given.frames[frame(2)].given_pose && block.frames[frame(2)].given_pose);
  EXPECT_LT((block.frames[frame(2)].given_pose->centre - Eigen::Vector3d(1, 2, 3)).norm(), 1e-9);
  EXPECT_LT(rotation_angle(block.frames[frame(2)].given_pose->rotation, poses.poses[0].rotation), 1e-9);
  EXPECT_EQ(block.frames[frame(1)].given_pose->centre, given.frames[frame(1)].given_pose->centre);
}

TEST_F(GivenBlock, KeysWithoutEffectAreRefused) {
  EXPECT_EQ(
      refusal_of("gps: {lever_arm_m: [0, 0, 1]}\n"),
      "block.yaml:3: 'lever_arm_m' is not used with 'block', whose positions have their own lever arms; take it out");
  EXPECT_THAT(refusal_of("gps: {lever_arm: [0, 0, 1]}\n"),
              testing::AllOf(HasSubstr("lever_arm_m"), testing::Not(HasSubstr("lever_arm_m, lever_arm_m"))));
  EXPECT_EQ(refusal_of("cameras: {grouping: one}\n"),
            "block.yaml:3: 'grouping' is not used with 'block', whose file defines the cameras; take it out");
  EXPECT_EQ(refusal_of("attitude: {sigma_deg: 1}\n"),
            "block.yaml:3: 'attitude' is not used with a 'block' without attitudes; take it out");
  EXPECT_EQ(refusal_of("attitude: {use: false}\n"), "") << "is what the block is";
  std::filesystem::create_directories(folder_.path("masks"));
  EXPECT_EQ(refusal_of("masks: masks\n"),
            "block.yaml:3: 'masks' is not used with a 'block' without image files; take it out");
  EXPECT_EQ(refusal_of("cameras: {default: {mask: given.h5}}\n"),
            "block.yaml:3: 'mask' is not used with a 'block' without image files; take it out");
  for (const std::string section :
       {"features: {max_features: 10}", "candidates: {neighbours: 3}", "matching: {k_best: 3}"})
    EXPECT_THAT(refusal_of("gps: {use: true}\n" + section + "\n"),
                HasSubstr("block.yaml:4: '" + section.substr(0, section.find(':')) +
                          "' is not used with 'tie_points', which are measured and matched already; take it out"));
  EXPECT_EQ(refusal_of("tiles: {min_tiles: 2}\n"), "");
}

TEST_F(GivenBlock, ControlIsAddedToItsOwn) {
  const std::string header = "name,x,y,z,image,column_px,row_px\n", control = "control: control.csv\n";
  Block given = read_block(folder_.path("given.h5"));
  given.control_points.push_back({"own", PointRole::kCheck, {0, 0, 0}, {1, 1, 1}, {}});
  write_block(folder_.path("given.h5"), given);
  write_file(folder_.path("control.csv"), header + "new,1,2,3," + given.name_of(ImageIndex(1)) + ",100,200\n");
  const Block block = read_text(folder_, "block: given.h5\ntie_points: tie_points.h5\n" + control).block;
  ASSERT_THAT(block.control_points, SizeIs(2));
  EXPECT_EQ(block.control_points[0].name, "own");
  EXPECT_EQ(block.control_points[1].position, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(block.control_points[1].measurements.at(0).image, ImageIndex(1));
  write_file(folder_.path("control.csv"), header + "own,1,2,3,,,\n");
  EXPECT_EQ(refusal_of(control), "block.yaml: control point 'own' appears twice; names must differ");
}

TEST_F(GivenBlock, PositionsThatItHasNotAreNotWeighed) {
  Block given = read_block(folder_.path("given.h5"));
  for (Frame& f : given.frames) f.position_prior.reset();
  write_block(folder_.path("given.h5"), given);
  EXPECT_EQ(refusal_of("gps: {sigma_horizontal_m: 1}\n"),
            "block.yaml:3: 'gps' is not used with a 'block' without positions; take it out");
  EXPECT_EQ(refusal_of("gps: {use: false}\n"), "");
}

}  // namespace
}  // namespace megablock
