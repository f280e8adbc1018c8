// Tests the calibration file and the project key that adopts it, the names of mounts, the figures and the page.
#include "io/block/calibration.h"

#include <gmock/gmock.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "io/base/error.h"
#include "io/block/residual_field.h"
#include "io/evaluation/calibration_report.h"
#include "io/project/project.h"
#include "io/report/calibration_page.h"
#include "io/simulate/blocks/simulate.h"
#include "io/simulate/files/write.h"
#include "io/store/units/block_file.h"
#include "io/store/units/state_file.h"
#include "tests/support/io/image_files.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

using fixture::message_of;
using ::testing::HasSubstr;

class CalibrationFile : public ::testing::Test {
 protected:
  CalibrationFile() {
    SimulationOptions options =
        SimulationOptions::of(SimulationOptions::Scene::kTargetField, SimulationOptions::Path::kSparse);
    options.rig_cameras = 3;
    write_simulated_block(options, folder_.path());
    block_ = read_block(folder_.path("given.h5"));
    truth_ = read_state(folder_.path("truth.h5"));
    calibration_.project = "field.yaml";
    for (CameraIndex c(0); block_.cameras.contains(c); ++c.value) {
      CameraCalibration camera{block_.cameras[c].name, block_.cameras[c].intrinsics, truth_.cameras[c]};
      camera.sigma[kFocal] = 0.125;
      camera.sigma[kRadial1] = 0.0005;
      calibration_.cameras.push_back(camera);
    }
    for (std::int32_t m = 0; m < 3; ++m) {
      MountCalibration mount;
      mount.rig = RigIndex(0);
      mount.mount = m;
      mount.camera = block_.rigs[RigIndex(0)].mounts[static_cast<std::size_t>(m)].camera;
      mount.name = mount_name(block_, RigIndex(0), m);
      mount.pose = truth_.mounts[RigIndex(0)][static_cast<std::size_t>(m)];
      mount.field = ResidualField(block_.cameras[mount.camera]);
      if (m > 0) mount.covariance.diagonal() << 1e-8, 1e-8, 4e-8, 1e-6, 1e-6, 1e-6;
      calibration_.mounts.push_back(mount);
    }
  }

  void write(const std::string& name, const std::string& text) { std::ofstream(folder_.path(name)) << text; }
  Project read(const std::string& line) {
    write("other.yaml", "block: given.h5\ntie_points: tie_points.h5\n" + line);
    return read_project(folder_.path("other.yaml"));
  }
  std::string refusal(const std::string& file) {
    write("calibration.yaml", file);
    return message_of<InputError>([&] { read("calibration: calibration.yaml\n"); });
  }

  ScratchDirectory folder_;
  Block block_;
  BlockState truth_;
  RigCalibration calibration_;
};

TEST_F(CalibrationFile, IsTakenOverHeld) {
  write("calibration.yaml", calibration_yaml(calibration_, "megablock"));
  const Block block = read("calibration: calibration.yaml\n").block;
  for (CameraIndex c(0); block.cameras.contains(c); ++c.value) {
    EXPECT_EQ(block.cameras[c].intrinsics, truth_.cameras[c]);  // to the last bit
    for (const double sigma : block.cameras[c].prior_sigma) EXPECT_EQ(sigma, 0);
  }
  for (std::size_t m = 0; m < 3; ++m) {
    const Mount& mount = block.rigs[RigIndex(0)].mounts[m];
    const Pose& truth = truth_.mounts[RigIndex(0)][m];
    EXPECT_TRUE(mount.held());
    EXPECT_LT(rotation_angle(mount.pose.rotation, truth.rotation), 1e-14);
    EXPECT_LT((mount.pose.centre - truth.centre).norm(), 1e-14);
  }
}

TEST_F(CalibrationFile, SigmasMayBecomePriors) {
  write("calibration.yaml", calibration_yaml(calibration_, "megablock"));
  const Block block = read("calibration: {file: calibration.yaml, hold: false}\n").block;
  EXPECT_EQ(block.cameras[CameraIndex(1)].prior_sigma[kFocal], 0.125);
  EXPECT_EQ(block.cameras[CameraIndex(1)].prior_sigma[kRadial1], 0.0005);
  EXPECT_EQ(block.cameras[CameraIndex(1)].prior_sigma[kPrincipalX], 0);
  EXPECT_TRUE(block.rigs[RigIndex(0)].mounts[0].held());
  EXPECT_NEAR(block.rigs[RigIndex(0)].mounts[1].position_sigma_m, 1e-3, 1e-9);
  EXPECT_NEAR(block.rigs[RigIndex(0)].mounts[1].rotation_sigma_rad, std::sqrt(2e-8), 1e-7);  // of three digits
}

TEST_F(CalibrationFile, UnknownNamesAreRefusedWithTheirPlace) {
  EXPECT_THAT(refusal("mounts:\n  c31: {rotation: [0, 0, 0], translation: [0, 0, 0]}\n"
                      "  c99: {rotation: [0, 0, 0], translation: [0, 0, 0]}\n"),
              AllOf(HasSubstr("calibration.yaml:3: the block has no rig camera 'c99'; it has 'c22'"),
                    HasSubstr("correct its name")));
  EXPECT_THAT(refusal("cameras:\n  front: {focal_px: 1400}\n"),
              HasSubstr("calibration.yaml:2: the block has no camera 'front'"));
}

TEST_F(CalibrationFile, MistakesAreRefusedWithTheirPlace) {
  EXPECT_THAT(refusal("mounts:\n  c22: {rotation: [0, 0, 0]}\n"),
              AllOf(HasSubstr("calibration.yaml:2"), HasSubstr("'translation' (three numbers) is missing")));
  EXPECT_THAT(refusal("mount:\n  c22: {}\n"), HasSubstr("did you mean 'mounts'?"));
  EXPECT_THAT(refusal("mounts:\n  c22: {rotation: [0, 0, 0], translation: [0, 0, 0], sigma_position_m: -1}\n"),
              HasSubstr("calibration.yaml:2: mounts.c22.sigma_position_m must lie in [0, 1e+06], not -1"));
  EXPECT_THAT(refusal("mounts:\n  c22: {rotation: [0, 0, 0], translation: [0, 0, 1e300]}\n"),
              HasSubstr("calibration.yaml:2: translation: [0, 0, 1e+300] m is no place on a vehicle"));
  EXPECT_THAT(refusal("mounts:\n  c22: {rotation: [0, -90, 0], translation: [0, 0, 0]}\n"),
              HasSubstr("calibration.yaml:2: rotation: [0, -90, 0] is more than a full turn"));
  EXPECT_THAT(message_of<InputError>([&] { read("calibration: {hold: true}\n"); }), HasSubstr("key 'file' is missing"));
  EXPECT_THAT(message_of<InputError>([&] { read("calibration: nowhere.yaml\n"); }), HasSubstr("nowhere.yaml"));
}

TEST_F(CalibrationFile, RigCamerasWithoutEntryAreNamed) {
  write("calibration.yaml", "mounts:\n  c22: {rotation: [0, 0, 0], translation: [0, 0, 0]}\n");
  const Project project = read("calibration: calibration.yaml\n");
  ASSERT_EQ(project.warnings.size(), 2u);
  EXPECT_THAT(project.warnings[0], HasSubstr("keeps its previous mount"));
}

TEST_F(CalibrationFile, MountsOfOneCameraAreNumbered) {
  EXPECT_EQ(mount_name(block_, RigIndex(0), 1), block_.cameras[CameraIndex(1)].name);
  for (Mount& mount : block_.rigs[RigIndex(0)].mounts) mount.camera = CameraIndex(0);
  EXPECT_EQ(mount_name(block_, RigIndex(0), 1), block_.cameras[CameraIndex(0)].name + "#1");
}

TEST_F(CalibrationFile, PageAndFiguresNameEveryCamera) {
  MountCalibration& mount = calibration_.mounts[1];
  mount.field.add(block_.cameras[mount.camera], {100, 100}, {0.5, 0});
  mount.quadrant = {1, 0, 0, 0};
  calibration_.warnings = {"c31: hardly any measurements <here>"};
  calibration_.verification = calibration_.verification_before = RigFit();
  const std::string html = calibration_html(calibration_, block_), text = calibration_text(calibration_);
  const auto json = nlohmann::json::parse(calibration_json(calibration_));
  EXPECT_THAT(html, HasSubstr("hardly any measurements &lt;here&gt;"));
  EXPECT_THAT(html, HasSubstr("aria-label=\"Coverage of the sensor\""));
  EXPECT_THAT(text, HasSubstr("warning: c31: hardly any measurements <here>"));
  for (const MountCalibration& m : calibration_.mounts) {
    EXPECT_THAT(html, HasSubstr("<h3>" + m.name + "</h3>"));
    EXPECT_THAT(text, HasSubstr("\n" + m.name));
  }
  EXPECT_THAT(html, ::testing::Not(HasSubstr(">nan")));
  EXPECT_THAT(text, ::testing::Not(HasSubstr("nan ")));
  EXPECT_NEAR(json["mounts"][1]["position_sigma_m"].get<double>(), 1e-3, 1e-12);
  EXPECT_EQ(json["mounts"][1]["quadrants"][0], 1);
}

TEST(ImageFit, IsRootMeanSquareAndMeanOfLengths) {
  ImageFit fit;
  fit.add(Eigen::Vector2d(3, 4));
  fit.add(Eigen::Vector2d(0, 1));
  EXPECT_DOUBLE_EQ(fit.rms_px(), std::sqrt(26.0 / 4));
  EXPECT_DOUBLE_EQ(fit.mean_px(), 3);
  EXPECT_DOUBLE_EQ(fit.deviation_px(), 2);
  EXPECT_TRUE(std::isnan(ImageFit().rms_px()));
}

}  // namespace
}  // namespace megablock
