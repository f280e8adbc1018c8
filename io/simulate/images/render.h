// Renders the images of a City.
//
// A pixel is the mean of 2 x 2 samples where they show several objects, and of two samples on the diagonal elsewhere.
// Each sample is one ray, with the distortion of the true camera: X_ground = C + t R' (X/Z, Y/Z, 1).
// Internal to io/: it is not installed.
#pragma once

#include <opencv2/core.hpp>

#include "io/simulate/images/city.h"
#include "io/simulate/images/vehicle_view.h"

namespace megablock {

// The viewing directions of a camera at the 2 x 2 samples of every pixel. They are computed once for all its images.
class RayTable {
 public:
  RayTable(const Camera& camera, const Intrinsics& intrinsics);
  // Normalised image coordinates (X/Z, Y/Z) of a sample; rows and columns of samples, two per pixel.
  const Eigen::Vector2f& at(int row, int column) const {
    return rays_[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(column)];
  }
  int rows() const { return rows_; }
  int columns() const { return columns_; }

 private:
  int rows_, columns_;
  std::vector<Eigen::Vector2f> rays_;
};

// The vehicle in the images of a camera, and the light on it at the place of one image.
struct SeenVehicle {
  const VehicleView* view = nullptr;  // none: the image shows the scene alone
  VehicleView::Light light{};
};

// Renders an 8-bit BGR image. `camera` is the pose ground -> camera. The sensor noise depends only on `seed`, and the
// image does not depend on the number of threads.
cv::Mat render_image(const City& city, const RayTable& rays, const Pose& camera, double focal_px, std::uint64_t seed,
                     const SeenVehicle& vehicle = {});

}  // namespace megablock
