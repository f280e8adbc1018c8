// Intersects tracks at given poses, and finds their outliers. Up to 30 pairs of rays give a point each, and the point
// with the smallest truncated sum of squares wins. Errors are angles between rays, so points need not be projected.
// Internal to adjust/: it is not installed.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "adjust/orientation/steps/orientation_graph.h"
#include "geometry/transform/pose.h"

namespace megablock {

// Values of the graph's unknowns during initial orientation.
struct OrientationValues {
  std::vector<std::optional<Pose>> frames;             // [graph.frames] empty: not oriented
  std::vector<Intrinsics> cameras;                     // [graph.cameras]
  std::vector<std::optional<Eigen::Vector3d>> points;  // [tracks]
  std::vector<std::uint8_t> kept;                      // [observations] 1: agrees with its point

  std::optional<Pose> camera(const OrientationGraph& graph, std::int32_t image) const;
};

struct IntersectionLimits {
  double max_error_rad = 0.01;      // of an inlier
  double min_intersection_rad = 0;  // largest angle between two inliers, at least
};

// Intersects all tracks and fills `points` and `kept` of the values.
void intersect_tracks(const OrientationGraph& graph, const std::vector<Eigen::Vector3d>& rays,
                      const IntersectionLimits& limits, OrientationValues& values);

}  // namespace megablock
