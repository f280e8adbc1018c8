// Gives the pose of one frame from its observations of intersected points.
// Internal to adjust/: it is not installed.
#pragma once

#include "adjust/orientation/steps/track_intersection.h"

namespace megablock {

// Draws random samples of three rays from all images of the frame (geometry/resection/resection_estimators.h) and
// refines the pose by Gauss-Newton on the angles of the inliers. Empty when fewer than `min_points` rays, or less than
// a quarter of them, are inliers. Deterministic: the seed is the row of the frame.
std::optional<Pose> resect_frame(const OrientationGraph& graph, const std::vector<Eigen::Vector3d>& rays,
                                 std::int32_t frame, double max_error_rad, int min_points,
                                 const OrientationValues& values);

}  // namespace megablock
