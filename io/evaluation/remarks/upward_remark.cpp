#include "io/evaluation/remarks/upward_remark.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "geometry/numbers/decompositions.h"

namespace megablock {

namespace {

constexpr double kUpward = 0.5;     // sine of 30 degrees above the horizon
constexpr double kThin = 0.25;      // thickness of a plane over its width
constexpr std::size_t kPlaces = 3;  // that a plane has at least

// The positions and control points that place the block.
std::vector<Eigen::Vector3d> given_places(const BlockResult& result) {
  std::vector<Eigen::Vector3d> places;
  for (FrameIndex f(0); result.block.frames.contains(f); ++f.value)
    if (const auto& prior = result.block.frames[f].position_prior; prior && result.state.oriented[f])
      places.push_back(prior->position);
  for (std::size_t p = 0; p < std::min(result.control.size(), result.block.control_points.size()); ++p) {
    const ControlPoint& point = result.block.control_points[p];
    if (point.role == PointRole::kControl && result.control[p].takes_part() && point.position.allFinite())
      places.push_back(point.position);
  }
  return places;
}

bool in_a_plane(const std::vector<Eigen::Vector3d>& places) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& place : places) mean += place / static_cast<double>(places.size());
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& place : places) scatter += (place - mean) * (place - mean).transpose();
  const SymmetricEigen3 eigen = symmetric_eigen3(scatter);  // squares of lengths
  return eigen.values(0) <= kThin * kThin * eigen.values(1);
}

bool directions_are_observed(const Block& block) {
  return !block.verticals.empty() || std::ranges::any_of(block.frames, [](const Frame& frame) {
    return frame.attitude_prior.has_value() || frame.given_pose.has_value();
  });
}

}  // namespace

std::string upward_text(const BlockResult& result) {
  const Block& block = result.block;
  if (result.state.oriented.size() != block.frames.size() || directions_are_observed(block)) return "";
  std::int64_t cameras = 0, upward = 0;
  for (ImageIndex i(0); block.images.contains(i); ++i.value) {
    const Image& image = block.images[i];
    if (!result.state.oriented[image.frame] || sees_sideways(block.cameras[block.camera_of(i)].intrinsics.model()))
      continue;
    const Pose& mount = result.state.mounts[block.frames[image.frame].rig][static_cast<std::size_t>(image.mount)];
    const Pose camera = camera_pose(result.state.frames[image.frame], mount);
    ++cameras;
    upward += (camera.rotation.conjugate() * Eigen::Vector3d::UnitZ()).z() > kUpward;
  }
  if (3 * upward <= 2 * cameras) return "";
  const std::vector<Eigen::Vector3d> places = given_places(result);
  if (places.size() < kPlaces || !in_a_plane(places)) return "";
  return fmt::format(
      "{} of {} cameras look upward: the block may be upside down, as with east and north exchanged in the positions "
      "or "
      "control points, which lie in a plane; if the cameras looked down, check these lists",
      upward, cameras);
}

}  // namespace megablock
