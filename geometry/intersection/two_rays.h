// Intersects two rays in closed form. The point is the midpoint of their shortest connection. There is one solution.
// triangulation.h takes any number of rays and minimises image residuals; this function is for inner loops.
//
// With the base m = C_2 - C_1 and unit directions d_1, d_2, the nearest points are C_1 + a d_1 and C_2 + b d_2, where
//
//     a = det(m, d_2, d_1 x d_2) / |d_1 x d_2|^2,    b = det(m, d_1, d_1 x d_2) / |d_1 x d_2|^2
//
// (R. Goldman, "Intersection of two lines in three-space", Graphics Gems, 1990). R. Hartley and P. Sturm,
// "Triangulation", CVIU 68(2), 1997, compare this estimate with better ones. Degenerate case: parallel rays.
#pragma once

#include <Eigen/Geometry>
#include <optional>

#include "geometry/intersection/triangulation.h"

namespace megablock {

struct TwoRayPoint {
  Eigen::Vector3d position;
  double distance_first = 0, distance_second = 0;  // distances of the nearest points from the two centres
  double miss = 0;                                 // length of the shortest connection
};

// Returns the midpoint, in the frame of the rays. Ignores the weights of the rays. Empty for rays parallel within a
// microradian (which includes a zero base with equal directions), for a point behind a centre, and for input that is
// not finite.
inline std::optional<TwoRayPoint> intersect_two_rays(const Ray& first, const Ray& second) {
  const Eigen::Vector3d base = second.origin - first.origin, normal = first.direction.cross(second.direction);
  const double square = normal.squaredNorm();
  constexpr double kParallel = 1e-12;
  if (!(square > kParallel)) return std::nullopt;
  TwoRayPoint point;
  point.distance_first = base.cross(second.direction).dot(normal) / square;
  point.distance_second = base.cross(first.direction).dot(normal) / square;
  if (!(point.distance_first > 0 && point.distance_second > 0)) return std::nullopt;
  point.position =
      first.origin + 0.5 * (point.distance_first * first.direction + base + point.distance_second * second.direction);
  point.miss = std::abs(base.dot(normal)) / std::sqrt(square);
  if (!point.position.allFinite()) return std::nullopt;
  return point;
}

}  // namespace megablock
