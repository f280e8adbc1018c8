#include "geometry/resection/resection_estimators.h"

#include <Eigen/Cholesky>
#include <algorithm>

namespace megablock {

Solutions<Pose, 8> ResectionEstimator::solve(const std::array<std::size_t, 3>& rows) const {
  const PointRay &a = rays_[rows[0]], &b = rays_[rows[1]], &c = rays_[rows[2]];
  return solve_gp3p({a.origin, b.origin, c.origin}, {a.direction, b.direction, c.direction},
                    {a.point, b.point, c.point});
}

// Truncated squares, shifted so that outliers contribute zero: sum over r < t of (r / t)^2 - 1. Lower is better.
double ResectionEstimator::cost(const Pose& pose, double threshold) const {
  const auto squared_residual = squared_residuals(pose);
  const double limit = threshold * threshold;
  double sum = 0;
  for (std::size_t i = 0; i < size(); ++i)
    if (const double r2 = squared_residual(i); r2 < limit) sum += r2 / limit - 1;
  return sum;
}

Pose ResectionEstimator::adjusted(Pose pose, double threshold, int max_iterations) const {
  const double limit = threshold * threshold;
  double current = cost(pose, threshold);
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    const Eigen::Matrix3d rotation = pose.rotation.toRotationMatrix();
    Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
    PoseIncrement right = PoseIncrement::Zero();
    // Normal equations of the unknown increment (w, d) of the pose, from the residual u - v, where u is the unit
    // direction to the point and v the measured one. d(u) / d(point in the rig) = (I - u u') / distance.
    for (const PointRay& ray : rays_) {
      const Eigen::Vector3d difference = ray.point - pose.centre;
      const Eigen::Vector3d inside = rotation * difference - ray.origin;
      const double distance = inside.norm();
      const Eigen::Vector3d unit = inside / distance, residual = unit - ray.direction;
      if (!(residual.squaredNorm() <= 4 * limit)) continue;
      const Eigen::Matrix3d by_centre = -(Eigen::Matrix3d::Identity() - unit * unit.transpose()) / distance * rotation;
      Eigen::Matrix<double, 3, 6> by_pose;
      by_pose << by_centre * skew<double>(difference), by_centre;
      const double weight = 1 / (1 + 4 * residual.squaredNorm() / limit);
      normal.noalias() += weight * by_pose.transpose() * by_pose;
      right.noalias() -= weight * by_pose.transpose() * residual;
    }
    const PoseIncrement step = normal.ldlt().solve(right);
    if (!step.allFinite()) break;
    const Pose next = pose_update(pose, step);
    const double there = cost(next, threshold);
    if (!(there <= current)) break;
    const bool settled = current - there < 1e-9 * static_cast<double>(size());
    pose = next;
    current = there;
    if (settled) break;
  }
  return pose;
}

}  // namespace megablock
