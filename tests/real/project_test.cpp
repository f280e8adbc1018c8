// Tests the project reader on real images.
#include "io/project/project.h"

#include <gmock/gmock.h>
#include <unistd.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "io/block/crs.h"
#include "io/project/project_init.h"
#include "real_data.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

using fixture::real_data;
namespace fs = std::filesystem;

// A project file in a folder of its own.
class ProjectFile {
 public:
  explicit ProjectFile(const std::string& text) { std::ofstream(path()) << text; }
  std::string path() const { return scratch_.path("block.yaml"); }

 private:
  ScratchDirectory scratch_;
};

Project read_set(const std::string& set, const std::string& more = "") {
  return read_project(ProjectFile("images: " + real_data(set) + "\n" + more).path());
}

std::int64_t with_position(const Block& block) {
  return std::count_if(block.frames.begin(), block.frames.end(),
                       [](const Frame& frame) { return frame.position_prior.has_value(); });
}

TEST(RealProject, BrightonBeachHasPositionsAndGimbalAngles) {
  MEGABLOCK_NEEDS_DATA("brighton_beach");
  const Project project = read_set("brighton_beach");
  EXPECT_THAT(project.warnings, ::testing::IsEmpty());
  ASSERT_EQ(project.block.images.size(), 18u);
  ASSERT_EQ(project.block.cameras.size(), 1u);
  const Camera& camera = project.block.cameras[CameraIndex(0)];
  EXPECT_TRUE(camera.focal_known);
  EXPECT_NEAR(camera.intrinsics[kFocal], 2000 * 3.61 / 6.17, 0.01);
  EXPECT_EQ(with_position(project.block), 18);
  for (const Frame& frame : project.block.frames) {
    ASSERT_TRUE(frame.attitude_prior) << frame.name;
    EXPECT_LT((frame.attitude_prior->rotation_cw * Eigen::Vector3d(0, 0, -1) - Eigen::Vector3d::UnitZ()).norm(), 0.02)
        << "looks down";
    EXPECT_TRUE(std::isfinite(frame.time_s));
    EXPECT_LT(frame.position_prior->position.head<2>().norm(), 300);
  }
}

TEST(RealProject, SenecaHasOneImageOfAnotherSize) {
  MEGABLOCK_NEEDS_DATA("seneca");
  const Project project = read_set("seneca");
  EXPECT_EQ(project.block.images.size(), 167u);
  ASSERT_EQ(project.block.cameras.size(), 2u);
  EXPECT_EQ(project.block.cameras[CameraIndex(0)].width, 1620) << "IMG_0446.jpg, a camera of its own";
  EXPECT_NEAR(project.block.cameras[CameraIndex(1)].intrinsics[kFocal], 1248.9, 0.1);
  EXPECT_EQ(with_position(project.block), 167);
}

TEST(RealProject, LundHasSigmasFromTheHeader) {
  MEGABLOCK_NEEDS_DATA("lund");
  const Project project = read_set("lund");
  EXPECT_EQ(project.block.images.size(), 29u);
  EXPECT_EQ(with_position(project.block), 29);
  EXPECT_EQ(project.block.frames[FrameIndex(0)].position_prior->sigma, Eigen::Vector3d(10, 10, 20));
}

TEST(RealProject, BerlinReadsControlAndRigFiles) {
  MEGABLOCK_NEEDS_DATA("berlin");
  const std::string folder = real_data("berlin");
  const Project project =
      read_set("berlin", "control: " + folder + "/ground_control_points.json\nrigs:\n  cameras: " + folder +
                             "/rig_cameras_example.json\n  assignments: " + folder + "/rig_assignments_example.json\n");
  const Block& block = project.block;
  ASSERT_EQ(block.images.size(), 3u);
  ASSERT_EQ(block.frames.size(), 3u);
  EXPECT_EQ(block.rigs.size(), 1u);
  const std::string file = folder + "/ground_control_points.json";
  nlohmann::json json;
  std::ifstream(file) >> json;
  std::size_t located = 0;
  for (const auto& point : json["points"]) located += point.contains("position");
  ASSERT_EQ(block.control_points.size(), located);
  // The first point's first measurement: 02.jpg at (-0.015689, -0.0625362).
  const ImageMeasurement& m = block.control_points[0].measurements[0];
  EXPECT_EQ(block.name_of(m.image), "02.jpg");
  EXPECT_NEAR(m.pixel.x(), 1632 - 0.015689 * 3264, 1e-9);
  EXPECT_NEAR(m.pixel.y(), 1224 - 0.0625362 * 3264, 1e-9);
  const Georeference reference(block.ground);
  const Geodetic back = reference.to_geodetic(block.control_points[0].position);
  EXPECT_NEAR(back.latitude_deg, 52.51926834404209, 1e-10);
  EXPECT_NEAR(back.height_m, 14.946108, 1e-5);
  EXPECT_LT((block.control_points[0].position - block.frames[FrameIndex(0)].position_prior->position).norm(), 150);
}

// OpenSfM's own reconstruction of the set: with its poses and camera, its points project where its tracks were
// measured, so that axes and image coordinates are read as it means them.
TEST(RealProject, BerlinsReconstructionProjectsOntoItsTracks) {
  MEGABLOCK_NEEDS_DATA("berlin");
  nlohmann::json json;
  std::ifstream(real_data("berlin") + "/reconstruction_example.json") >> json;
  const auto& model = json[0];
  const auto& entry = *model["cameras"].begin();
  const double width = entry["width"], height = entry["height"], size = std::max(width, height);
  const Intrinsics intrinsics = {
      entry["focal"].get<double>() * size, width / 2, height / 2, entry["k1"], entry["k2"], 0, 0, 0};
  std::ifstream tracks(real_data("berlin") + "/tracks_example.csv");
  std::string line, image, track;
  std::getline(tracks, line);
  std::vector<double> residuals;
  while (std::getline(tracks, line)) {
    std::istringstream words(line);
    std::int64_t feature;
    double x, y;
    words >> image >> track >> feature >> x >> y;
    const auto point = model["points"].find(track);
    if (point == model["points"].end()) continue;
    const auto& shot = model["shots"][image];
    const auto vector = [](const nlohmann::json& v) { return Eigen::Vector3d(v[0], v[1], v[2]); };
    const Eigen::Quaterniond rotation = rotation_exp<double>(vector(shot["rotation"]));
    const Eigen::Vector3d camera = rotation * vector((*point)["coordinates"]) + vector(shot["translation"]);
    const Eigen::Vector2d measured(x * size + width / 2, y * size + height / 2);
    residuals.push_back((project(intrinsics, camera) - measured).norm());
  }
  ASSERT_GT(residuals.size(), 500u);
  std::nth_element(residuals.begin(), residuals.begin() + static_cast<std::ptrdiff_t>(residuals.size() / 2),
                   residuals.end());
  EXPECT_LT(residuals[residuals.size() / 2], 3) << "px of 3264, median";
}

TEST(RealProject, InitDescribesEachSet) {
  for (const std::string set : {"brighton_beach", "seneca", "lund", "berlin"}) {
    MEGABLOCK_NEEDS_DATA(set);
    const ProjectFile place("");
    fs::remove(place.path());
    InitOptions options;
    options.images = real_data(set);
    options.output = place.path();
    EXPECT_THAT(init_project(options), ::testing::HasSubstr(" with a position")) << set;
    const Project read = read_project(place.path());
    EXPECT_TRUE(read.block.ground.georeferenced);
    if (set == "berlin")  // its list has a point with marks and without coordinates
      EXPECT_THAT(read.warnings, ::testing::ElementsAre(::testing::HasSubstr("point '1' is left out")));
    else
      EXPECT_THAT(read.warnings, ::testing::IsEmpty());
  }
}

}  // namespace
}  // namespace megablock
