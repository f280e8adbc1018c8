#include "adjust/orientation/steps/levelling.h"

#include <cmath>

namespace megablock {

MeanAxes mean_axes(const Block& block, const BlockState& state, const std::vector<FrameIndex>& frames) {
  MeanAxes axes;
  double count = 0;
  for (const FrameIndex frame : frames) {
    if (!state.oriented[frame]) continue;
    const RigIndex rig = block.frames[frame].rig;
    for (std::size_t m = 0; m < block.rigs[rig].cameras().size(); ++m) {
      const Eigen::Quaterniond turn = camera_pose(state.frames[frame], state.mounts[rig][m]).rotation.conjugate();
      axes.view += turn * Eigen::Vector3d::UnitZ();
      axes.down += turn * Eigen::Vector3d::UnitY();
      ++count;
    }
  }
  if (count > 0) axes.view /= count, axes.down /= count;
  return axes;
}

Eigen::Quaterniond turn_about(const Eigen::Vector3d& axis, const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  const double sine = axis.dot(from.cross(to));
  const double cosine = from.dot(to) - axis.dot(from) * axis.dot(to);
  return Eigen::Quaterniond(Eigen::AngleAxisd(std::atan2(sine, cosine), axis));
}

// A mean that is shorter than 0.7 across the line does not say what is down; if both are long, the distance of the
// points decides between an aerial block and a street.
Eigen::Vector3d which_points_down(const MeanAxes& axes, const Eigen::Vector3d& line, double distance_m) {
  const auto across = [&](const Eigen::Vector3d& v) { return (v - line * line.dot(v)).norm(); };
  constexpr double kClear = 0.7, kNadirDistance = 25;  // metres
  if (across(axes.view) < kClear) return axes.down;
  if (across(axes.down) < kClear) return axes.view;
  return distance_m > kNadirDistance ? axes.view : axes.down;
}

}  // namespace megablock
