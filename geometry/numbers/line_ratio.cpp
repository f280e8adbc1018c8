#include "geometry/numbers/line_ratio.h"

#include <algorithm>
#include <cmath>

#include "geometry/numbers/decompositions.h"

namespace megablock {

double line_ratio(std::span<const Eigen::Vector3d> points) {
  if (points.size() < 3) return 0;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  // Eigenvalues of the scatter matrix are the sums of squares along the principal axes.
  for (const Eigen::Vector3d& point : points) mean += point / static_cast<double>(points.size());
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& point : points) spread += (point - mean) * (point - mean).transpose();
  const Eigen::VectorXd values = symmetric_eigen(spread).values;  // ascending
  return values(2) > 0 ? std::sqrt(std::max(values(1), 0.0) / values(2)) : 0;
}

}  // namespace megablock
