// Pose of one frame from its observations of intersected points.
#pragma once

#include "adjust/orientation/steps/track_intersection.h"

namespace megablock {

// Random samples of three rays of any of the frame's images (geometry/resection/resection_estimators.h), then
// Gauss-Newton on the angles of the agreeing ones. Empty when fewer than `min_points` rays agree within the limit or
// the agreeing share is below a quarter. Deterministic: seeded by the frame's row.
std::optional<Pose> resect_frame(const OrientationGraph& graph, const std::vector<Eigen::Vector3d>& rays,
                                 std::int32_t frame, double max_error_rad, int min_points,
                                 const OrientationValues& values);

}  // namespace megablock
