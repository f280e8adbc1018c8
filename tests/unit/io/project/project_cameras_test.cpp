// Tests what the project file says of cameras, and their masks.
#include <gmock/gmock.h>

#include "tests/support/io/project_text.h"

namespace megablock {
namespace {

using fixture::read_text;
using fixture::refusal;
using fixture::write_image_file;
using fixture::write_line;
using ::testing::AllOf;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

// What the section of a camera does not say, the section of all cameras does.
TEST(ProjectCameras, ASectionOfACameraKeepsWhatDefaultCalibrates) {
  ScratchDirectory folder;
  write_line(folder, 1);
  const auto sigmas = [&](const std::string& common, const std::string& own) {
    return read_text(folder, "images: images\ncameras:\n  default: {" + common +
                                 "}\n  DJI FC300S 64x48 3.61mm: {focal_px: 100" + own + "}\n")
        .block.cameras[CameraIndex(0)]
        .prior_sigma;
  };
  EXPECT_THAT(sigmas("calibrate: false", ""), Each(0.0));
  EXPECT_EQ(sigmas("calibrate: [focal]", ""), (IntrinsicSigmas{5}));
  EXPECT_EQ(sigmas("calibrate: false", ", calibrate: [focal]"), (IntrinsicSigmas{5}));
  EXPECT_EQ(sigmas("calibrate: [k1]", ", model: pinhole, calibrate: [focal]"), (IntrinsicSigmas{5}));
}

TEST(ProjectCameras, CameraSettingsOverrideTheHeaders) {
  ScratchDirectory folder;
  write_line(folder, 1);
  write_image_file(folder.path("images/x.jpg"), 100, 80, 50);
  write_image_file(folder.path("mask.png"), 64, 48, 0);
  const Block block = read_text(folder,
                                "images: images\n"
                                "cameras:\n"
                                "  default: {calibrate: false}\n"
                                "  DJI FC300S 64x48 3.61mm:\n"
                                "    focal_mm: 3.61\n"
                                "    sensor_mm: 7.22\n"
                                "    principal_point_px: [31.5, 24.25]\n"
                                "    distortion: {k1: -0.1, p2: 1e-3}\n"
                                "    calibrate: [focal, k1, principal_point]\n"
                                "    mask: mask.png\n")
                          .block;
  const Camera& camera = block.cameras[CameraIndex(0)];
  EXPECT_DOUBLE_EQ(camera.intrinsics[kFocal], 32);
  EXPECT_EQ(camera.intrinsics[kPrincipalX], 31.5);
  EXPECT_EQ(camera.intrinsics[kRadial1], -0.1);
  EXPECT_EQ(camera.intrinsics[kDecentring2], 1e-3);
  EXPECT_EQ(camera.prior_sigma, (IntrinsicSigmas{1.6, 1.28, 1.28, 0.2, 0, 0, 0, 0}));
  EXPECT_EQ(camera.mask_path, folder.path("mask.png"));
  EXPECT_THAT(block.cameras[CameraIndex(1)].prior_sigma, Each(0.0));
}

// The cameras of the line are DJI's FC300S, which reads its rows in 33 ms (io/images/readout_times.csv).
TEST(ProjectCameras, ReadoutTimesAreThoseOfTheTableOrTheProject) {
  ScratchDirectory folder;
  write_line(folder, 1);
  const auto camera = [&](const std::string& keys) {
    return read_text(folder, "images: images\ncameras:\n  default: {" + keys + "}\n").block.cameras[CameraIndex(0)];
  };
  EXPECT_EQ(camera("").readout_s, 0.033);
  EXPECT_TRUE(camera("").estimate_readout);  // the images must confirm it
  EXPECT_TRUE(camera("readout_ms: auto").estimate_readout);
  EXPECT_FALSE(camera("readout_ms: 0").estimate_readout);
  EXPECT_EQ(camera("readout_ms: 0").readout_s, 0);
  EXPECT_EQ(camera("readout_ms: -21.5").readout_s, -0.0215);
  EXPECT_FALSE(camera("readout_ms: 20").estimate_readout);
  EXPECT_TRUE(camera("readout_ms: estimate").estimate_readout);
  EXPECT_EQ(camera("readout_ms: estimate").readout_s, 0);
  EXPECT_EQ(camera("readout_ms: 20").prior_sigma, camera("").prior_sigma);
  const Block own = read_text(folder,
                              "images: images\ncameras:\n  default: {readout_ms: 0}\n"
                              "  DJI FC300S 64x48 3.61mm: {readout_ms: auto}\n")
                        .block;
  EXPECT_EQ(own.cameras[CameraIndex(0)].readout_s, 0.033);
  EXPECT_TRUE(own.cameras[CameraIndex(0)].estimate_readout);
  // The images of the line have no times.
  for (const std::string value : {"20", "estimate"})
    EXPECT_THAT(read_text(folder, "images: images\ncameras: {default: {readout_ms: " + value + "}}\n").warnings,
                ElementsAre(HasSubstr("has a rolling shutter (readout_ms), but its images have no times")));
  EXPECT_THAT(refusal(folder, "images: images\ncameras: {default: {readout_ms: 1200}}\n"), HasSubstr("readout_ms"));
  EXPECT_THAT(refusal(folder, "images: images\ncameras: {default: {readout_ms: guess}}\n"),
              AllOf(HasSubstr("readout_ms"), HasSubstr("guess")));
}

TEST(ProjectCameras, MaskFolderIsReadByCameraName) {
  ScratchDirectory folder;
  write_line(folder, 1);
  write_image_file(folder.path("masks/DJI FC300S 64x48 3.61mm.png"), 64, 48, 0);
  write_image_file(folder.path("masks/other.png"), 64, 48, 0);
  const Project project = read_text(folder, "images: images\nmasks: masks\n");
  EXPECT_EQ(project.block.cameras[CameraIndex(0)].mask_path, folder.path("masks/DJI FC300S 64x48 3.61mm.png"));
  EXPECT_THAT(project.warnings, ElementsAre(HasSubstr("other.png")));
  write_image_file(folder.path("masks/DJI FC300S 64x48 3.61mm.png"), 32, 48, 0);
  EXPECT_THAT(refusal(folder, "images: images\nmasks: masks\n"), HasSubstr("32 x 48"));
}

}  // namespace
}  // namespace megablock
