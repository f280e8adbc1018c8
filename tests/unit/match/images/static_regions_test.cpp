// The mask of the vehicle, found in simulated images of a drive and compared with the truth.
#include "match/images/static_regions.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "io/base/error.h"
#include "io/simulate/blocks/simulate.h"
#include "io/simulate/images/render.h"

namespace megablock {
namespace {

// Images of one camera of the Stereopolis vehicle along a drive, and the region that shows the vehicle.
struct Pictures {
  std::vector<cv::Mat> grey;
  cv::Mat truth;  // 0: the vehicle
};

Pictures drive(const std::string& camera_name, bool vehicle, int frames = 24) {
  SimulationOptions options = SimulationOptions::of(SimulationOptions::Scene::kStereopolis);
  options.frames = frames;
  options.bridge = false;
  options.street_spacing_m = 60;
  options.image_width = 240;
  options.image_height = 136;
  options.focal_px = 175;
  const Layout layout = make_layout(options);
  const City city(options, layout);
  CameraIndex camera(0);
  while (layout.block.cameras[camera].name != camera_name) ++camera.value;
  const RayTable rays(layout.block.cameras[camera], layout.truth.cameras[camera]);
  const Pose& mount = layout.truth.mounts.front()[static_cast<std::size_t>(camera.value)];
  const VehicleView view(options, rays, mount);
  Pictures pictures;
  for (FrameIndex f(0); layout.truth.frames.contains(f); ++f.value) {
    const Pose& rig = layout.truth.frames[f];
    const SeenVehicle seen{vehicle ? &view : nullptr, VehicleView::light_at(city, rig)};
    cv::Mat grey;
    cv::cvtColor(render_image(city, rays, camera_pose(rig, mount), options.focal_px, 7 + f.value, seen), grey,
                 cv::COLOR_BGR2GRAY);
    pictures.grey.push_back(grey);
  }
  pictures.truth = vehicle ? view.mask() : cv::Mat(136, 240, CV_8U, cv::Scalar(255));
  return pictures;
}

cv::Mat mask_of(const Pictures& pictures, const StaticRegionOptions& options = {}) {
  StaticRegionFinder finder(options);
  for (const cv::Mat& grey : pictures.grey) finder.add(finder.gradients(grey), grey.size());
  return finder.mask();
}

double share(const cv::Mat& a, const cv::Mat& of) {
  return static_cast<double>(cv::countNonZero(a)) / static_cast<double>(cv::countNonZero(of));
}

class VehicleMask : public testing::TestWithParam<const char*> {};

// Here a reduced pixel is a pixel of the image, so the margin would be half of the mast's width.
TEST_P(VehicleMask, IsFoundAndLittleElse) {
  const Pictures pictures = drive(GetParam(), true);
  ASSERT_GT(cv::countNonZero(pictures.truth == 0), 600);
  StaticRegionOptions options;
  options.margin_px = 0;
  const cv::Mat mask = mask_of(pictures, options);
  const cv::Mat found = mask == 0, vehicle = pictures.truth == 0;
  EXPECT_GE(share(found & vehicle, found | vehicle), 0.9);
  EXPECT_LE(share(found & ~vehicle, ~vehicle), 0.03);
}

INSTANTIATE_TEST_SUITE_P(Cameras, VehicleMask, testing::Values("c22", "c31", "c41"),
                         [](const auto& camera) { return std::string(camera.param); });

// Neither the sky, which the upward camera sees in every image, nor the road is taken for the vehicle.
TEST(StaticRegions, WithoutAVehicleNothingIsMasked) {
  for (const char* camera : {"c34", "c22"})
    EXPECT_EQ(cv::countNonZero(mask_of(drive(camera, false)) == 0), 0) << camera;
}

TEST(StaticRegions, TooFewImagesAndOtherSizesAreRefused) {
  EXPECT_THROW(mask_of(drive("c22", true, 12)), InputError);
  StaticRegionFinder finder({});
  const cv::Mat grey(90, 160, CV_8U, cv::Scalar(100)), other(80, 160, CV_8U, cv::Scalar(100));
  finder.add(finder.gradients(grey), grey.size());
  EXPECT_THROW(finder.add(finder.gradients(other), other.size()), InputError);
  StaticRegionOptions options;
  options.max_images = 5;
  EXPECT_THROW(options.check(), InputError);
}

}  // namespace
}  // namespace megablock
