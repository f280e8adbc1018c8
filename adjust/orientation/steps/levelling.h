// Levels a block whose known places lie on one line: the rotation about the line is open, and gravity closes it.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "io/block/block.h"

namespace megablock {

// The means over the images of the viewing direction (z axis) and of the y axis of the camera, ground axes. They are
// not normalised: a mean over images that look to all sides is short.
struct MeanAxes {
  Eigen::Vector3d view = Eigen::Vector3d::Zero(), down = Eigen::Vector3d::Zero();
};

// Those of the images of the oriented frames, in the axes of the state.
MeanAxes mean_axes(const Block& block, const BlockState& state, const std::vector<FrameIndex>& frames);

// The rotation about the unit axis that brings the part of `from` across the axis onto that of `to`.
Eigen::Quaterniond turn_about(const Eigen::Vector3d& axis, const Eigen::Vector3d& from, const Eigen::Vector3d& to);

// Which of the two mean axes points down, for a line of unit direction `line`. Images that look across the line at
// points more than 25 m away are taken to look down (nadir); in all others the y axis is taken to point down (street).
// `distance_m` is the median distance of the points from the images, metres.
Eigen::Vector3d which_points_down(const MeanAxes& axes, const Eigen::Vector3d& line, double distance_m);

}  // namespace megablock
