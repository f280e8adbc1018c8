// Robust intersection of tracks that may hold wrong observations, for given poses: every pair of rays (up to a limit)
// is a hypothesis, the one with most agreeing rays wins. Errors are angles between rays, so nothing is projected.
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
  double max_error_rad = 0.01;      // of a ray that agrees
  double min_intersection_rad = 0;  // between the two most different agreeing rays
};

// Intersects all tracks; fills points and kept.
void intersect_tracks(const OrientationGraph& graph, const std::vector<Eigen::Vector3d>& rays,
                      const IntersectionLimits& limits, OrientationValues& values);

}  // namespace megablock
