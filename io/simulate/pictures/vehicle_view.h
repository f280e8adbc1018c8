// What the cameras of the Stereopolis vehicle see of the vehicle itself: the same in all images of a camera, light
// apart. Roof, a dome and a thin mast on it, and a scanner at the left side, seen by the level cameras; those that look
// up the facades see nothing of it.
#pragma once

#include <array>
#include <opencv2/core.hpp>
#include <vector>

#include "io/simulate/pictures/city.h"

namespace megablock {

class RayTable;

class VehicleView {
 public:
  // Of a camera on its mount.
  VehicleView(const SimulationOptions& options, const RayTable& rays, const Pose& mount);

  // Light on the six faces (-x, x, -y, y, -z, z of the rig) where the vehicle stands.
  using Light = std::array<float, 6>;
  static Light light_at(const City& city, const Pose& rig);

  // Whether a sample of the ray table meets the vehicle.
  bool covers(int row, int column) const { return surface_[at(row, column)] >= 0; }
  Eigen::Vector3f colour(int row, int column, const Light& light) const {
    const Surface& s = surfaces_[static_cast<std::size_t>(surface_[at(row, column)])];
    return light[static_cast<std::size_t>(s.face)] * s.colour;
  }
  // Its mask as a project takes them: 0 where most samples of a pixel show the vehicle, else 255.
  cv::Mat mask() const;

 private:
  struct Surface {
    Eigen::Vector3f colour;  // red, green, blue in full light
    int face;
  };
  std::size_t at(int row, int column) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(column);
  }
  int rows_, columns_;                 // of samples
  std::vector<std::int32_t> surface_;  // [samples] row of surfaces_; -1: the scene
  std::vector<Surface> surfaces_;
};

}  // namespace megablock
