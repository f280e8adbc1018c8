// Finds the largest set of a point's rays that agree with one another, at held poses.
//
// Every pair of rays (a fixed number of pairs where there are many) proposes a point. The point with the least
// truncated cost sum min(r^2, t^2) is refined with the rays that pass, until these no longer change; they are the
// result. ransac.h is not used, because it refines every point that is the best so far, as long as the cost falls. That
// takes longer, and in one point of a hundred it leaves out a ray that passes in the end.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "geometry/intersection/triangulation.h"

namespace megablock {

// The length of the residual of a view in sigmas; infinite behind the camera.
double residual_sigmas(const PointView& view, const Eigen::Vector3d& point);

struct ConsistentRays {
  Eigen::Vector3d point;
  std::vector<std::uint8_t> passing;  // [views] 1 = within the threshold of the point; two or more views are
};

// `threshold` is in sigmas. `seed` is that of the point; it selects the pairs where there are many rays. Empty when no
// two rays agree.
std::optional<ConsistentRays> find_consistent_rays(std::span<const PointView> views, double threshold,
                                                   std::uint64_t seed);

// Whether two of the rays marked in `used` [views] meet in the point at a larger angle than this one.
bool meet_wider_than(std::span<const PointView> views, const std::vector<std::uint8_t>& used,
                     const Eigen::Vector3d& point, double cos_angle);

}  // namespace megablock
