#include "io/simulate/images/render.h"

#include <gtest/gtest.h>
#include <omp.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>

#include "io/base/error.h"
#include "io/base/hash.h"
#include "io/block/crs.h"
#include "io/project/inputs/pose_csv.h"
#include "io/project/project.h"
#include "io/simulate/blocks/aerial.h"
#include "io/simulate/blocks/street.h"
#include "io/simulate/files/write_rendered.h"
#include "io/simulate/images/city.h"
#include "io/simulate/scene/simulation_options.h"
#include "io/store/units/state_file.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

namespace fs = std::filesystem;

SimulationOptions small_options(SimulationOptions::Scene scene) {
  SimulationOptions options;
  options.scene = scene;
  options.frames = 4;
  options.image_width = 240;
  options.image_height = 180;
  options.focal_px = 200;
  options.rig_cameras = 3;
  options.gps_sigma_m = 0.05;
  return options;
}

class RenderTest : public testing::TestWithParam<SimulationOptions::Scene> {
 protected:
  RenderTest() : options_(small_options(GetParam())) {
    layout_ =
        GetParam() == SimulationOptions::Scene::kStreet ? make_street_layout(options_) : make_aerial_layout(options_);
    city_ = std::make_unique<City>(options_, layout_);
  }
  Pose pose(std::int64_t image) const {
    const Image& entry = layout_.block.images[ImageIndex(image)];
    return camera_pose(layout_.truth.frames[entry.frame],
                       layout_.truth.mounts[RigIndex(0)][static_cast<std::size_t>(entry.mount)]);
  }
  CameraIndex camera(std::int64_t image) const { return layout_.block.camera_of(ImageIndex(image)); }
  cv::Mat render(std::int64_t image) const {
    const RayTable rays(layout_.block.cameras[camera(image)], layout_.truth.cameras[camera(image)]);
    return render_image(*city_, rays, pose(image), options_.focal_px, 5);
  }

  SimulationOptions options_;
  Layout layout_;
  std::unique_ptr<City> city_;
};

// Distance to the nearest box by trying each, and to the ground by small steps.
double brute_force(const City& city, const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double limit) {
  double nearest = limit;
  for (const Box& box : city.boxes()) {
    double first = 0, last = limit;
    for (int k = 0; k < 3; ++k) {
      const double a = (box.low[k] - origin[k]) / direction[k], b = (box.high[k] - origin[k]) / direction[k];
      first = std::max(first, std::min(a, b));
      last = std::min(last, std::max(a, b));
    }
    if (first < last) nearest = std::min(nearest, first);
  }
  double t = 0;
  for (const double step : {0.02, 1e-4}) {
    for (; t < nearest; t += step) {
      const Eigen::Vector3d p = origin + t * direction;
      if (p.z() < city.ground().height(p.x(), p.y())) break;
    }
    if (t >= nearest) return nearest;
    if (step > 0.01) t -= step;
  }
  return t;
}

TEST_P(RenderTest, RaysMeetTheNearestSurface) {
  Random random(3, Random::Purpose::kNoise);
  int ground = 0, box = 0;
  for (int i = 0; i < 300; ++i) {
    const Pose view = pose(random.below(std::ssize(layout_.block.images)));
    const Eigen::Vector3d ray(random.uniform(-0.6, 0.6), random.uniform(-0.45, 0.45), 1);
    const Eigen::Vector3d direction = (view.rotation.conjugate() * ray).normalized();
    const City::Hit hit = city_->cast(view.centre, direction);
    const double expected = brute_force(*city_, view.centre, direction, 150);
    if (hit.object == City::kSky || hit.distance > 140) {
      EXPECT_GT(expected, 139);
      continue;
    }
    EXPECT_NEAR(hit.distance, expected, 5e-3) << i;
    EXPECT_LT(hit.normal.dot(direction), 0);
    (hit.object == City::kGround ? ground : box) += 1;
  }
  EXPECT_GT(ground, 20);
  EXPECT_GT(box, 20);
}

// A point of a surface projects to the pixel that shows it: the ray of this pixel meets the same point, and both images
// have its colour there.
TEST_P(RenderTest, SurfacesAppearWhereTheyProject) {
  const std::int64_t first = 1 * std::ssize(layout_.block.cameras);
  const cv::Mat a = render(first);
  std::vector<double> in_a, of_surface;
  Random random(4, Random::Purpose::kNoise);
  for (int i = 0; i < 3000; ++i) {
    const Pose view = pose(first);
    const auto point = city_->sample({view.rotation, view.centre}, random);
    if (!point || !city_->visible(view.centre, *point)) continue;
    const Eigen::Vector3d inside = to_inside(view, point->position);
    if (inside.z() < 0.5 || inside.head<2>().norm() > inside.z()) continue;
    const Intrinsics& k = layout_.truth.cameras[camera(first)];
    const Eigen::Vector2d pixel = project(k, inside);
    if (pixel.x() < 2 || pixel.y() < 2 || pixel.x() > a.cols - 2 || pixel.y() > a.rows - 2) continue;
    const Eigen::Vector3d direction = view.rotation.conjugate() * *viewing_ray(k, pixel);
    const City::Hit hit = city_->cast(view.centre, direction);
    ASSERT_LT((hit.point - point->position).norm(), 1e-3);
    // Bilinear between pixel centres.
    const double u = pixel.x() - 0.5, v = pixel.y() - 0.5;
    const int c = static_cast<int>(u), r = static_cast<int>(v);
    double value = 0;
    for (const int dr : {0, 1})
      for (const int dc : {0, 1})
        value += std::abs(1 - dr - (v - r)) * std::abs(1 - dc - (u - c)) * a.at<cv::Vec3b>(r + dr, c + dc)[1];
    in_a.push_back(value);
    of_surface.push_back(static_cast<double>(city_->colour(hit, direction, 1 / options_.focal_px)[1]));
  }
  ASSERT_GT(in_a.size(), 200u);
  const auto n = static_cast<double>(in_a.size());
  double ma = 0, mb = 0, aa = 0, bb = 0, ab = 0;
  for (std::size_t i = 0; i < in_a.size(); ++i) ma += in_a[i] / n, mb += of_surface[i] / n;
  for (std::size_t i = 0; i < in_a.size(); ++i) {
    aa += (in_a[i] - ma) * (in_a[i] - ma);
    bb += (of_surface[i] - mb) * (of_surface[i] - mb);
    ab += (in_a[i] - ma) * (of_surface[i] - mb);
  }
  EXPECT_GT(ab / std::sqrt(aa * bb), 0.93);
  EXPECT_GT(std::sqrt(bb / n), 10);  // there is texture
}

TEST_P(RenderTest, PicturesDoNotDependOnThreads) {
  const int threads = omp_get_max_threads();
  omp_set_num_threads(1);
  const cv::Mat one = render(2);
  omp_set_num_threads(3);
  const cv::Mat three = render(2);
  omp_set_num_threads(threads);
  EXPECT_EQ(cv::norm(one, three, cv::NORM_INF), 0);
  EXPECT_GT(cv::norm(one, render(0), cv::NORM_INF), 0);
}

TEST_P(RenderTest, FilesAreAProject) {
  const bool street = GetParam() == SimulationOptions::Scene::kStreet;
  const ScratchDirectory folder;
  write_rendered_block(options_, folder.path());
  const Project project = read_project(folder.path("block.yaml"));
  ASSERT_EQ(std::ssize(project.block.frames), options_.frames);
  ASSERT_EQ(std::ssize(project.block.images), options_.frames * (street ? options_.rig_cameras : 1));
  EXPECT_TRUE(project.unreadable.empty());
  EXPECT_TRUE(project.warnings.empty());
  ASSERT_EQ(std::ssize(project.block.cameras), street ? options_.rig_cameras : 1);
  for (const Camera& c : project.block.cameras) {
    EXPECT_TRUE(c.focal_known);
    EXPECT_NEAR(c.intrinsics[kFocal], options_.focal_px, 0.01);
  }
  const PoseTable truth = read_pose_csv(folder.path("truth.csv"));
  const BlockState state = read_state(folder.path("truth.h5"));
  ASSERT_EQ(truth.names.size(), project.block.frames.size());
  ASSERT_TRUE(truth.ground);
  EXPECT_NEAR(truth.ground->latitude_deg, project.block.ground.latitude_deg, 1e-12);
  EXPECT_NEAR(truth.ground->longitude_deg, project.block.ground.longitude_deg, 1e-12);
  double sum = 0;
  for (std::size_t f = 0; f < truth.names.size(); ++f) {
    const Frame& frame = project.block.frames[FrameIndex(static_cast<std::int64_t>(f))];
    EXPECT_EQ(frame.name, truth.names[f]);
    EXPECT_EQ(truth.poses[f].centre, state.frames[FrameIndex(static_cast<std::int64_t>(f))].centre);
    ASSERT_TRUE(frame.position_prior);
    EXPECT_NEAR(frame.position_prior->sigma.z(), options_.gps_sigma_m, 1e-12);
    const PositionPrior& prior = *frame.position_prior;
    const Pose& pose = truth.poses[f];
    const Eigen::Vector3d error = prior.position - pose.centre - pose.rotation.conjugate() * prior.lever_arm;
    EXPECT_LT(error.norm(), 5 * options_.gps_sigma_m);
    sum += error.squaredNorm();
  }
  EXPECT_GT(std::sqrt(sum / static_cast<double>(3 * truth.names.size())), 0.4 * options_.gps_sigma_m);
  ASSERT_EQ(std::ssize(project.block.rigs), 1);
  for (std::size_t m = 0; m < project.block.rigs.front().mounts.size(); ++m) {
    const Mount& mount = project.block.rigs.front().mounts[m];
    EXPECT_TRUE(mount.held());
    EXPECT_LT((mount.pose.centre - state.mounts.front()[m].centre).norm(), 1e-12);
    EXPECT_LT(rotation_angle(mount.pose.rotation, state.mounts.front()[m].rotation), 1e-12);
  }
  // The approximate poses can be used in place of the images.
  std::ofstream(folder.path("block.yaml"), std::ios::app) << "poses: poses.csv\n";
  const Block with_poses = read_project(folder.path("block.yaml")).block;
  for (std::size_t f = 0; f < truth.names.size(); ++f) {
    const Frame& frame = with_poses.frames[FrameIndex(static_cast<std::int64_t>(f))];
    ASSERT_TRUE(frame.given_pose);
    EXPECT_LT((frame.given_pose->centre - truth.poses[f].centre).norm(), 5 * options_.start_position_error_m);
  }
  const std::string image = folder.path("images/" + project.block.name_of(ImageIndex(3)));
  const std::uint64_t before = hash_file(image);
  write_rendered_block(options_, folder.path(), EditedProject::kOverwrite);
  EXPECT_EQ(hash_file(image), before);
}

// Control as read from the project lies where the true cameras see it, in both files.
TEST_P(RenderTest, ControlFitsTheTruth) {
  options_.control_points = 4;
  options_.check_points = 2;
  options_.image_noise_px = 0.3;
  options_.frames = GetParam() == SimulationOptions::Scene::kStreet ? 3 : 6;
  const ScratchDirectory folder;
  write_rendered_block(options_, folder.path());
  const BlockState truth = read_state(folder.path("truth.h5"));
  for (const std::string file : {"control.csv", "gcp_list.txt"}) {
    std::ofstream(folder.path("block.yaml"))
        << "images: images\norigin: [48.85, 2.35, 100]\n"
        << "control: " << file << "\n"
        << (truth.mounts.front().size() > 1 ? "rigs: {cameras: rig_cameras.json, "
                                              "assignments: rig_assignments.json}\n"
                                            : "");
    const Block block = read_project(folder.path("block.yaml")).block;
    double chi2 = 0, n = 0;
    std::int64_t control = 0;
    for (const ControlPoint& point : block.control_points) {
      control += point.role == PointRole::kControl;
      for (const ImageMeasurement& m : point.measurements) {
        const Image& image = block.images[m.image];
        const auto& mounts = truth.mounts[block.frames[image.frame].rig];
        const Pose pose = camera_pose(truth.frames[image.frame], mounts[static_cast<std::size_t>(image.mount)]);
        const Eigen::Vector2d seen = project(truth.cameras[block.camera_of(m.image)], to_inside(pose, point.position));
        chi2 += ((seen - m.pixel) / options_.image_noise_px).squaredNorm();
        n += 2;
      }
      if (file == "gcp_list.txt") continue;
      EXPECT_NEAR(point.sigma.x(), options_.control_sigma_m, 1e-12);
      EXPECT_NEAR(point.measurements.front().sigma_px, options_.image_noise_px, 1e-12);
    }
    EXPECT_GE(control, 3);
    EXPECT_EQ(std::ssize(block.control_points) - control > 0, file == "control.csv");
    // Sigma 1 cm of the points is less than a tenth of a pixel in the aerial images, up to half a pixel in the street.
    EXPECT_LT(chi2 / n, GetParam() == SimulationOptions::Scene::kStreet ? 4 : 2) << file;
    EXPECT_GT(chi2 / n, 0.3) << file;
  }
}

TEST_P(RenderTest, HeldCamerasAreInTheProject) {
  options_.calibrate = false;
  options_.frames = 2;
  const ScratchDirectory folder;
  write_rendered_block(options_, folder.path());
  const Project project = read_project(folder.path("block.yaml"));
  const BlockState truth = read_state(folder.path("truth.h5"));
  ASSERT_EQ(project.block.cameras.size(), truth.cameras.size());
  for (std::size_t c = 0; c < truth.cameras.size(); ++c) {
    const Camera& held = project.block.cameras[CameraIndex(static_cast<std::int64_t>(c))];
    for (int p = 0; p < held.intrinsics.size(); ++p) {
      EXPECT_NEAR(held.intrinsics[p], truth.cameras[CameraIndex(static_cast<std::int64_t>(c))][p], 1e-8);
      EXPECT_EQ(held.prior_sigma[p], 0);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Scenes, RenderTest,
                         testing::Values(SimulationOptions::Scene::kAerial, SimulationOptions::Scene::kStreet),
                         [](const auto& scene) { return scene.index == 0 ? "aerial" : "street"; });

TEST(RenderFolder, AFolderThatCannotBeMadeIsReported) {
  const ScratchDirectory folder;
  const std::string occupied = folder.path("occupied");
  std::ofstream(occupied) << "a file";
  EXPECT_THROW(write_rendered_block(small_options(SimulationOptions::Scene::kAerial), occupied), InputError);
}

}  // namespace
}  // namespace megablock
