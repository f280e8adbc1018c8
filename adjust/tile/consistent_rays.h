// The largest part of a point's rays that agree with one another, at held poses.
//
// Every pair of rays (a fixed number of them where there are many) proposes a point. The one with the least truncated
// cost sum min(r^2, t^2) is refined with the rays that pass until they no longer change, and these are its part. Not by
// ransac.h: it refines every point that is the best so far, as long as the cost falls, which takes longer and in one
// point of a hundred leaves out a ray that passes in the end.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "geometry/intersection/triangulation.h"

namespace megablock {

// Length of a view's residual in sigmas; infinite behind the camera.
double residual_sigmas(const PointView& view, const Eigen::Vector3d& point);

struct ConsistentRays {
  Eigen::Vector3d point;
  std::vector<std::uint8_t> passing;  // [views] 1 = within the threshold of the point; at least two
};

// `threshold`: in sigmas. `seed`: the point's own, for which pairs of many rays are tried. Empty when no two agree.
std::optional<ConsistentRays> find_consistent_rays(std::span<const PointView> views, double threshold,
                                                   std::uint64_t seed);

// Whether two of the rays marked in `used` [views] meet in the point at more than an angle.
bool meet_wider_than(std::span<const PointView> views, const std::vector<std::uint8_t>& used,
                     const Eigen::Vector3d& point, double cos_angle);

}  // namespace megablock
