// Cameras of every model through files, project files, imports and exports.
#include <gmock/gmock.h>

#include "geometry/camera/camera.h"
#include "io/base/error.h"
#include "io/exchange/bal/bal_camera.h"
#include "io/exchange/export.h"
#include "io/exchange/import.h"
#include "io/project/project.h"
#include "io/simulate/blocks/simulate.h"
#include "io/store/hdf5/hdf5_cameras.h"
#include "io/store/units/adjustment_file.h"
#include "io/store/units/block_file.h"
#include "io/store/units/state_file.h"
#include "tests/support/geometry/camera_samples.h"
#include "tests/support/io/image_files.h"
#include "tests/support/io/scratch_directory.h"
#include "tests/support/io/small_result.h"

namespace megablock {
namespace {

using fixture::message_of;
using fixture::read_file;
using fixture::small_result;
using fixture::write_file;
using fixture::write_image_file;
using ::testing::AllOf;
using ::testing::HasSubstr;

Block every_camera() {
  Block block;
  for (const CameraModel& model : every_model()) {
    Camera camera;
    camera.name = model_name(model);
    camera.width = kSampleWidth;
    camera.height = kSampleHeight;
    camera.intrinsics = sample_camera(model);
    camera.prior_sigma = weak_sigmas(camera.intrinsics, 20, camera.width);
    block.cameras.push_back(std::move(camera));
  }
  return block;
}

// Files from before a model had its rare parameters: these are zero, and unknown in covariances.
TEST(CameraModelFiles, WithoutRareParametersAreRead) {
  ScratchDirectory folder;
  const std::vector<double> values = {1400, 960, 540, -0.1, 0.02, 0.003, 1e-3, 2e-3};
  const std::vector<CameraModel> models(1);
  {
    Hdf5Writer file(folder.path("old.h5"), "test");
    file.group("cameras");
    put_models(file, models);
    file.matrix("cameras/intrinsics", values, 8);
    file.array("cameras/covariance", std::vector<double>(64, 0.5), {1, 8, 8});
    file.close();
  }
  const Hdf5Reader file(folder.path("old.h5"), "test");
  EXPECT_EQ(get_intrinsics(file, 1).front(), (Intrinsics{1400, 960, 540, -0.1, 0.02, 0.003, 1e-3, 2e-3, 0, 0}));
  const Eigen::MatrixXd covariance = get_covariances(file, "cameras/covariance", models).front();
  ASSERT_EQ(covariance.rows(), 10);
  EXPECT_EQ(covariance(7, 7), 0.5);
  EXPECT_EQ(covariance(8, 8), 0);
}

TEST(CameraModelFiles, KeepTheChoiceOfParameters) {
  ScratchDirectory folder;
  Block block = every_camera();
  block.cameras[CameraIndex(1)].choose = true;
  block.cameras[CameraIndex(1)].choice = "estimated: f";
  write_block(folder.path("block.h5"), block);
  const Block back = read_block(folder.path("block.h5"));
  EXPECT_TRUE(back.cameras[CameraIndex(1)].choose);
  EXPECT_EQ(back.cameras[CameraIndex(1)].choice, "estimated: f");
  EXPECT_FALSE(back.cameras[CameraIndex(0)].choose);
}

TEST(CameraModelFiles, KeepEveryModel) {
  ScratchDirectory folder;
  const Block block = every_camera();
  EXPECT_NO_THROW(check(block));
  write_block(folder.path("block.h5"), block);
  const Block back = read_block(folder.path("block.h5"));
  ASSERT_EQ(back.cameras.size(), block.cameras.size());
  const BlockState state = initial_state(block);
  write_state(folder.path("state.h5"), state);
  EXPECT_EQ(read_state(folder.path("state.h5")).cameras, state.cameras);
  TileAdjustment adjustment;
  for (std::size_t c = 0; c < block.cameras.size(); ++c) {
    const CameraIndex index(static_cast<std::int64_t>(c));
    EXPECT_EQ(back.cameras[index].intrinsics, block.cameras[index].intrinsics);
    EXPECT_EQ(back.cameras[index].prior_sigma, block.cameras[index].prior_sigma);
    adjustment.cameras.push_back(index);
    adjustment.intrinsics.push_back(block.cameras[index].intrinsics);
    adjustment.camera_observations.push_back(1);
  }
  write_adjustment(folder.path("adjustment.h5"), adjustment);
  EXPECT_EQ(read_adjustment(folder.path("adjustment.h5")).intrinsics, adjustment.intrinsics);
}

class CameraModelProject : public ::testing::Test {
 protected:
  void SetUp() override {
    write_image_file(folder_.path("images/a.jpg"), 1920, 1080, 50);
    write_image_file(folder_.path("images/b.jpg"), 1920, 1080, 60);
  }
  Camera read(const std::string& camera) {
    write_file(folder_.path("block.yaml"), "images: images\ncameras:\n  default:\n" + camera);
    return read_project(folder_.path("block.yaml")).block.cameras[CameraIndex(0)];
  }
  std::string refusal(const std::string& camera) {
    return message_of<InputError>([&] { read(camera); });
  }
  ScratchDirectory folder_;
};

TEST_F(CameraModelProject, TakesModelAndParameters) {
  const Camera camera = read(
      "    model: ign-radial\n    focal_px: 1400\n    principal_point_px: [961, 542]\n"
      "    distortion: {a: -4.6e-8, b: 3.1e-14, c: -1.2e-21, sy: 545}\n    calibrate: [focal, a, sx]\n");
  EXPECT_EQ(camera.intrinsics,
            Intrinsics(*find_model("ign-radial"), {1400, 961, 542, 961, 545, -4.6e-8, 3.1e-14, -1.2e-21}));
  IntrinsicSigmas expected{};
  expected[kFocal] = 70;
  expected[kSymmetryX] = 96;
  expected[kRadialTerms] = 0.2 / (1400.0 * 1400.0);
  for (std::size_t p = 0; p < expected.size(); ++p) EXPECT_DOUBLE_EQ(camera.prior_sigma[p], expected[p]);
}

TEST_F(CameraModelProject, ChoosesParametersUnlessTold) {
  EXPECT_TRUE(read("    focal_px: 1400\n").choose);
  EXPECT_TRUE(read("    calibrate: auto\n").choose);
  const Camera affinity = read("    calibrate: [auto, b1]\n");
  EXPECT_TRUE(affinity.choose);
  EXPECT_GT(affinity.prior_sigma[kAffinity], 0);
  EXPECT_EQ(affinity.prior_sigma[kSkew], 0);
  for (const char* told : {"true", "false", "[focal]"})
    EXPECT_FALSE(read(std::string("    calibrate: ") + told + "\n").choose) << told;
  EXPECT_THAT(refusal("    calibrate: maybe\n"), HasSubstr("block.yaml:4"));
}

TEST_F(CameraModelProject, EstimatesAffinityWhenAsked) {
  const std::string start = "    focal_px: 1400\n    distortion: {b1: -2.5, b2: 0.5}\n";
  const Camera held = read(start), free = read(start + "    calibrate: [usual, b1, b2]\n");
  EXPECT_EQ(held.intrinsics[kAffinity], -2.5);
  EXPECT_EQ(held.intrinsics[kSkew], 0.5);
  EXPECT_EQ(held.prior_sigma[kAffinity], 0);
  EXPECT_EQ(held.prior_sigma[kSkew], 0);
  EXPECT_DOUBLE_EQ(free.prior_sigma[kAffinity], 14);
  EXPECT_DOUBLE_EQ(free.prior_sigma[kSkew], 14);
  for (int p = 0; p < kAffinity; ++p)
    EXPECT_EQ(free.prior_sigma[static_cast<std::size_t>(p)], held.prior_sigma[static_cast<std::size_t>(p)]);
}

TEST_F(CameraModelProject, KnowsEveryModel) {
  for (const CameraModel& model : every_model()) {
    const Camera camera = read("    model: " + model_name(model) + "\n");
    EXPECT_EQ(camera.intrinsics, start_intrinsics(model, 1.2 * 1920, 1920, 1080)) << model_name(model);
  }
  EXPECT_EQ(read("    model: equirectangular\n    calibrate: [cx]\n").prior_sigma[kPrincipalX], 0.02 * 1920);
}

TEST_F(CameraModelProject, RefusesByLine) {
  EXPECT_THAT(refusal("    model: ign\n"),
              HasSubstr("block.yaml:4: model: 'ign' is not a camera model; the models are brown,"));
  EXPECT_THAT(refusal("    model: odd-radial-12\n"), HasSubstr("odd-radial-N (N = 1 to 9)"));
  EXPECT_THAT(refusal("    model: ign-radial\n    distortion: {k1: 0.1}\n"),
              HasSubstr("block.yaml:5: unknown key 'k1'"));
  EXPECT_THAT(refusal("    model: pinhole\n    calibrate: [k1]\n"),
              AllOf(HasSubstr("block.yaml:5: calibrate: 'k1' is not a parameter of camera '"),
                    HasSubstr("(model pinhole); its parameters are auto, usual, focal, principal_point, f, cx, cy")));
  EXPECT_THAT(refusal("    model: legendre-2\n    calibrate: [width]\n"), HasSubstr("size of the image"));
  EXPECT_THAT(refusal("    model: equirectangular\n    focal_px: 300\n"), HasSubstr("block.yaml:5: the focal length"));
}

// The result with another model for both cameras and observations that fit exactly.
BlockResult result_with(const std::string& name) {
  BlockResult result = small_result();
  const CameraModel model = *find_model(name);
  for (std::size_t c = 0; c < result.block.cameras.size(); ++c) {
    const CameraIndex index(static_cast<std::int64_t>(c));
    Camera& camera = result.block.cameras[index];
    camera.intrinsics = sample_camera(model, camera.intrinsics[kFocal], camera.width, camera.height);
    camera.prior_sigma = weak_sigmas(camera.intrinsics, 10, camera.width);
    result.state.cameras[index] = camera.intrinsics;
  }
  result.camera_covariance.clear();
  return result;
}

TEST(CameraModelExchange, ColmapKeepsPinholeAndFisheye) {
  for (const char* model : {"pinhole", "opencv-fisheye"})
    for (const char* format : {"colmap-text", "colmap-bin"}) {
      ScratchDirectory folder;
      const BlockResult result = result_with(model);
      export_result(result, format, folder.path("model"));
      const ImportedBlock imported = import_block(format, folder.path("model"));
      EXPECT_EQ(imported.state.cameras, result.state.cameras) << model << " " << format;
    }
  ScratchDirectory folder;
  export_result(result_with("opencv-fisheye"), "colmap-text", folder.path("model"));
  EXPECT_THAT(read_file(folder.path("model/cameras.txt")), HasSubstr(" OPENCV_FISHEYE "));
}

std::vector<Eigen::Vector2d> measured_in(const BlockResult& result, const std::string& image) {
  std::vector<Eigen::Vector2d> all;
  for (std::size_t o = 0; o < result.tracks.image.size(); ++o)
    if (result.block.name_of(result.tracks.image[o]) == image)
      all.emplace_back(from_fixed_pixel(result.tracks.x[o]), from_fixed_pixel(result.tracks.y[o]));
  return all;
}

// fx = f + b1 and fy = f. The skew, which COLMAP does not have, is taken out of the observations.
TEST(CameraModelExchange, ColmapHasTwoFocalLengthsAndNoSkew) {
  const BlockResult result = result_with("brown");
  const Intrinsics given = result.state.cameras[CameraIndex(0)];
  ASSERT_NE(given[kAffinity], 0);
  ASSERT_NE(given[kSkew], 0);
  for (const char* format : {"colmap-text", "colmap-bin"}) {
    ScratchDirectory folder;
    export_result(result, format, folder.path("model"));
    const ImportedBlock imported = import_block(format, folder.path("model"));
    const Intrinsics back = imported.state.cameras[CameraIndex(0)];
    for (int p = 0; p < kSkew; ++p) EXPECT_NEAR(back[p], given[p], 1e-12 * std::abs(given[kFocal])) << p;
    EXPECT_EQ(back[kSkew], 0);
    const IntrinsicSigmas& sigma = imported.block.cameras[CameraIndex(0)].prior_sigma;
    EXPECT_GT(sigma[kAffinity], 0);
    EXPECT_EQ(sigma[kSkew], 0);
    // The rays of the observations stay the same.
    ASSERT_GT(imported.tracks.observation_count(), 50);
    std::int64_t compared = 0;
    for (std::int64_t t = 0; t < imported.tracks.track_count(); ++t)
      for (std::int64_t o = imported.tracks.begin[t]; o < imported.tracks.begin[t + 1]; ++o) {
        const Eigen::Vector2d pixel(from_fixed_pixel(imported.tracks.x[o]), from_fixed_pixel(imported.tracks.y[o]));
        const CameraIndex camera = imported.block.camera_of(imported.tracks.image[o]);
        const Intrinsics& k = result.state.cameras[camera];
        const auto ray = viewing_ray(imported.state.cameras[camera], pixel);
        ASSERT_TRUE(ray);
        const Eigen::Vector2d ours = project(k, *ray);
        double nearest = 1;
        for (const Eigen::Vector2d& measured : measured_in(result, imported.block.name_of(imported.tracks.image[o])))
          nearest = std::min(nearest, (measured - ours).norm());
        EXPECT_LT(nearest, 1.01 / 2048);  // the import rounds to 1/1024 px
        compared += std::abs(ours.x() - pixel.x()) > 0.1;
      }
    EXPECT_GT(compared, 10);
    EXPECT_THAT(export_note(result, format), HasSubstr("COLMAP files have no skew (b2)"));
  }
  EXPECT_THAT(export_note(result, "bundler"), HasSubstr("no affinity and skew (b1, b2)"));
  EXPECT_EQ(export_note(result, "csv"), "");
  EXPECT_EQ(export_note(result_with("pinhole"), "bal"), "");
}

// What COLMAP calibrated with two focal lengths.
TEST(CameraModelExchange, TakesTwoFocalLengths) {
  ScratchDirectory folder;
  write_file(folder.path("cameras.txt"),
             "1 OPENCV 100 80 91 90 50 40 -0.1 0.02 1e-3 2e-3\n2 PINHOLE 100 80 89 90 50 40\n"
             "3 FULL_OPENCV 100 80 90 90 50 40 -0.1 0.02 1e-3 2e-3 0.003 0 0 0\n");
  write_file(folder.path("images.txt"),
             "1 1 0 0 0 0 0 0 1 a.jpg\n\n2 1 0 0 0 0 0 0 2 b.jpg\n\n3 1 0 0 0 0 0 0 3 c.jpg\n\n");
  write_file(folder.path("points3D.txt"), "");
  const Block block = import_block("colmap-text", folder.path()).block;
  EXPECT_EQ(block.cameras[CameraIndex(0)].intrinsics, (Intrinsics{90, 50, 40, -0.1, 0.02, 0, 1e-3, 2e-3, 1}));
  EXPECT_EQ(block.cameras[CameraIndex(1)].intrinsics, (Intrinsics{90, 50, 40, 0, 0, 0, 0, 0, -1}));
  EXPECT_EQ(block.cameras[CameraIndex(2)].intrinsics, (Intrinsics{90, 50, 40, -0.1, 0.02, 0.003, 1e-3, 2e-3}));
  const auto estimated = [&](int camera, int p) {
    return block.cameras[CameraIndex(camera)].prior_sigma[static_cast<std::size_t>(p)] > 0;
  };
  EXPECT_TRUE(estimated(0, kAffinity) && estimated(1, kAffinity));
  EXPECT_FALSE(estimated(2, kAffinity));  // its focal lengths are one
  EXPECT_FALSE(estimated(1, kRadial1));   // COLMAP's model has no distortion
  EXPECT_FALSE(estimated(0, kSkew));
}

// The parameters stand in COLMAP's order, which is not ours, and come back.
TEST(CameraModelExchange, ColmapKeepsThinPrisms) {
  ScratchDirectory folder;
  BlockResult result = result_with("thin-prism-fisheye");
  const Intrinsics k(*find_model("thin-prism-fisheye"), {500, 320, 240, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8});
  for (Intrinsics& camera : result.state.cameras) camera = k;
  for (const char* format : {"colmap-text", "colmap-bin"}) {
    export_result(result, format, folder.path(format));
    EXPECT_EQ(import_block(format, folder.path(format)).block.cameras[CameraIndex(0)].intrinsics, k) << format;
  }
  EXPECT_THAT(read_file(folder.path("colmap-text/cameras.txt")),
              HasSubstr(" 500 500 320 240 0.1 0.2 0.5 0.6 0.3 0.4 0.7 0.8\n"));
}

// COLMAP's fisheyes with fewer terms are ours with the others zero.
TEST(CameraModelExchange, TakesColmapsRadialFisheyes) {
  ScratchDirectory folder;
  write_file(folder.path("cameras.txt"),
             "1 SIMPLE_RADIAL_FISHEYE 100 80 90 50 40 -0.1\n2 RADIAL_FISHEYE 100 80 91 50 40 -0.1 0.02\n");
  write_file(folder.path("images.txt"), "1 1 0 0 0 0 0 0 1 a.jpg\n\n2 1 0 0 0 0 0 0 2 b.jpg\n\n");
  write_file(folder.path("points3D.txt"), "");
  const Block block = import_block("colmap-text", folder.path()).block;
  const CameraModel fisheye = *find_model("opencv-fisheye");
  EXPECT_EQ(block.cameras[CameraIndex(0)].intrinsics, Intrinsics(fisheye, {90, 50, 40, -0.1, 0, 0, 0}));
  EXPECT_EQ(block.cameras[CameraIndex(1)].intrinsics, Intrinsics(fisheye, {91, 50, 40, -0.1, 0.02, 0, 0}));
}

TEST(CameraModelExchange, RefusesByCamera) {
  ScratchDirectory folder;
  const BlockResult panorama = result_with("equirectangular");
  const std::string camera =
      "camera '" + panorama.block.cameras[CameraIndex(0)].name + "' has the model equirectangular, ";
  for (const char* format : {"colmap-text", "colmap-bin"})
    EXPECT_THAT(message_of<InputError>([&] { export_result(panorama, format, folder.path("model")); }),
                HasSubstr(camera + "which COLMAP does not have"));
  for (const char* format : {"bal", "bundler"})
    EXPECT_THAT(message_of<InputError>([&] { export_result(panorama, format, folder.path("file")); }),
                HasSubstr("has the model equirectangular, whose images BAL"));
}

TEST(CameraModelExchange, BalTakesCorrectedPixels) {
  const Intrinsics k = sample_camera(*find_model("ign-radial"));
  const Eigen::Vector2d pixel(300, 900);
  const auto image = to_bal_image(k, pixel);
  ASSERT_TRUE(image);
  const Eigen::Vector3d ray = *viewing_ray(k, pixel);
  EXPECT_LT((*image - k[kFocal] * Eigen::Vector2d(ray.x() / ray.z(), -ray.y() / ray.z())).norm(), 1e-9);
  EXPECT_EQ(to_bal(Pose(), k).k1, 0);
}

TEST(CameraModelExchange, CsvLeavesCellsOfOtherModelsEmpty) {
  ScratchDirectory folder;
  BlockResult result = result_with("pinhole");
  Intrinsics& brown = result.state.cameras[CameraIndex(1)];
  brown = result.block.cameras[CameraIndex(1)].intrinsics = {1000, 500, 400, -0.1, 0, 0, 0, 0};
  export_result(result, "csv", folder.path("tables"));
  const std::string text = read_file(folder.path("tables/cameras.csv"));
  EXPECT_THAT(text, HasSubstr("name,width,height,model,f,cx,cy,k1,k2,k3,p1,p2,b1,b2\n"));
  EXPECT_THAT(text, HasSubstr(",,,,,,,\n"));
  EXPECT_THAT(text, HasSubstr(",brown,1000,500,400,-0.1,0,0,0,0,0,0\n"));
}

TEST(CameraModelSimulation, ObservesByTheModel) {
  for (const char* model : {"ign-radial", "legendre-3", "opencv-fisheye", "equirectangular"}) {
    SimulationOptions options;
    options.scene = SimulationOptions::Scene::kStreet;
    options.frames = 20;
    options.rig_cameras = 2;
    options.points_per_frame = 60;
    options.camera_model = model;
    const SimulatedBlock s = simulate_block(options);
    double squares = 0;
    int behind = 0, observations = 0;
    for (std::int64_t t = 0; t < s.tracks.track_count(); ++t)
      for (std::int64_t o = s.tracks.begin[t]; o < s.tracks.begin[t + 1]; ++o) {
        const Image& image = s.block.images[s.tracks.image[o]];
        const Pose& mount = s.truth.mounts[s.block.frames[image.frame].rig][static_cast<std::size_t>(image.mount)];
        const Eigen::Vector3d inside = to_camera(s.truth.frames[image.frame], mount, s.points[t]);
        const Eigen::Vector2d measured(from_fixed_pixel(s.tracks.x[o]), from_fixed_pixel(s.tracks.y[o]));
        squares += reprojection(s.truth.cameras[s.block.camera_of(s.tracks.image[o])], inside, measured).squaredNorm();
        behind += inside.z() < 0;
        ++observations;
      }
    EXPECT_NEAR(std::sqrt(squares / (2 * observations)), options.image_noise_px, 0.05) << model;
    EXPECT_EQ(behind > observations / 10, std::string(model) == "equirectangular") << model;
    EXPECT_EQ(s.block.cameras[CameraIndex(0)].intrinsics.model(), s.truth.cameras[CameraIndex(0)].model());
  }
  SimulationOptions unknown;
  unknown.camera_model = "fish";
  EXPECT_THAT(message_of<InputError>([&] { unknown.check(); }), HasSubstr("camera_model 'fish' is not one of: brown,"));
}

}  // namespace
}  // namespace megablock
