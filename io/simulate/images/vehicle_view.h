// Renders the Stereopolis vehicle in the images of its own cameras. Apart from the light it looks the same in all
// images of a camera. The level cameras see the roof, a dome and a thin mast on it, and a scanner at the left side;
// cameras that look up the facades do not see the vehicle.
//
// The parts are boxes in axes of the rig, so that the view depends on the mount alone and is made once per camera. Only
// the light changes: the six faces of a box have six brightnesses, which the pose of the rig decides.
// Internal to io/: it is not installed.
#pragma once

#include <array>
#include <opencv2/core.hpp>
#include <vector>

#include "io/simulate/images/city.h"

namespace megablock {

class RayTable;

class VehicleView {
 public:
  // The view of a camera with this mount.
  VehicleView(const SimulationOptions& options, const RayTable& rays, const Pose& mount);

  // The light on the six faces (-x, x, -y, y, -z, z of the rig) at the place of the vehicle.
  using Light = std::array<float, 6>;
  static Light light_at(const City& city, const Pose& rig);

  // Whether a sample of the ray table meets the vehicle.
  bool covers(int row, int column) const { return surface_[at(row, column)] >= 0; }
  Eigen::Vector3f colour(int row, int column, const Light& light) const {
    const Surface& s = surfaces_[static_cast<std::size_t>(surface_[at(row, column)])];
    return light[static_cast<std::size_t>(s.face)] * s.colour;
  }
  // The mask of the vehicle, as a project uses it: 0 where most samples of a pixel show the vehicle, else 255.
  cv::Mat mask() const;

 private:
  struct Surface {
    Eigen::Vector3f colour;  // red, green, blue in full light
    int face;
  };
  std::size_t at(int row, int column) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(column);
  }
  int rows_, columns_;                 // numbers of samples
  std::vector<std::int32_t> surface_;  // [samples] row of surfaces_; -1: the scene
  std::vector<Surface> surfaces_;
};

}  // namespace megablock
