#include "geometry/vanishing/vanishing_votes.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace megablock {

std::optional<Eigen::Vector3d> vanishing_point_by_votes(std::span<const InterpretationPlane> planes, double tolerance) {
  constexpr double kSamePlane = 1e-6;  // radians
  const double scale = 1 / std::sin(tolerance);
  std::optional<Eigen::Vector3d> best;
  double most = 0;
  for (std::size_t i = 0; i < planes.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      const Eigen::Vector3d across = planes[i].normal.cross(planes[j].normal);
      if (!(across.norm() > kSamePlane)) continue;
      const Eigen::Vector3d axis = across.normalized();
      double votes = 0;
      for (const InterpretationPlane& plane : planes)
        votes += std::max(0.0, 1 - scale * std::abs(axis.dot(plane.normal)));
      if (votes > most) most = votes, best = axis;
    }
  return best;
}

}  // namespace megablock
