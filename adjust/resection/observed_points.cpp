// Whitens the residuals. The covariance of a residual is C = sigma^2 I + (J R) C_X (J R)', with its Cholesky factor
//
//     L = | a 0 |,   a = sqrt(C_00), b = C_10 / a, c = sqrt(C_11 - b^2),   L^-1 v = (v_0 / a, (v_1 - b v_0 / a) / c).
//         | b c |
//
// The residual and its derivative are multiplied by L^-1. The dependence of C on the pose is left out of the
// derivative: it is of second order where residuals are small.
#include "adjust/resection/observed_points.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "geometry/estimation/ransac.h"
#include "geometry/resection/gp3p.h"

namespace megablock {

std::optional<WhitenedResidual> whitened(const ObservedPoint& observation, const Pose& pose, bool with_jacobian) {
  const auto r = ray_residual(observation.ray, to_inside(pose, observation.point));
  if (!r) return std::nullopt;
  const Eigen::Matrix<double, 2, 3> by_ground = r->by_point * pose.rotation.toRotationMatrix();
  const Eigen::Matrix2d covariance = observation.sigma_px * observation.sigma_px * Eigen::Matrix2d::Identity() +
                                     by_ground * observation.covariance * by_ground.transpose();
  // The Cholesky factor of a 2x2 matrix, written out because this is the innermost loop.
  const double a = std::sqrt(covariance(0, 0)), b = covariance(1, 0) / a,
               c = std::sqrt(std::max(covariance(1, 1) - b * b, 1e-300));
  const auto solve = [&](const auto& v) {
    std::decay_t<decltype(v.eval())> x = v;
    x.row(0) /= a;
    x.row(1) = (x.row(1) - b * x.row(0)) / c;
    return x;
  };
  WhitenedResidual w{solve(r->pixels), Eigen::Matrix<double, 2, 6>::Zero(), r->pixels.squaredNorm()};
  if (with_jacobian) w.by_pose = solve((r->by_point * in_rig_by_pose(pose, observation.point)).eval());
  return w;
}

void add_normal_equations(std::span<const ObservedPoint> observations, const Pose& pose, double limit_squared,
                          PoseNormal& normal, PoseIncrement& right) {
  for (const ObservedPoint& observation : observations) {
    const auto w = whitened(observation, pose, true);
    if (!w || w->residual.squaredNorm() > limit_squared) continue;
    normal += w->by_pose.transpose() * w->by_pose;
    right -= w->by_pose.transpose() * w->residual;
  }
}

Solutions<Pose, 8> ObservedPointEstimator::solve(const std::array<std::size_t, 3>& rows) const {
  const ObservedPoint &a = observations_[rows[0]], &b = observations_[rows[1]], &c = observations_[rows[2]];
  // Two cameras of a rig may see the same point. Two of its rays do not make two points of a sample.
  if (a.id == b.id || a.id == c.id || b.id == c.id) return {};
  return solve_gp3p({a.ray.origin, b.ray.origin, c.ray.origin}, {a.ray.direction, b.ray.direction, c.ray.direction},
                    {a.point, b.point, c.point});
}

std::optional<Pose> ObservedPointEstimator::refine(Pose pose, double threshold) const {
  constexpr int kSteps = 2;
  for (int step = 0; step < kSteps; ++step) {
    PoseNormal normal = PoseNormal::Zero();
    PoseIncrement right = PoseIncrement::Zero();
    add_normal_equations(observations_, pose, threshold * threshold, normal, right);
    const PoseIncrement increment = normal.ldlt().solve(right);
    if (!increment.allFinite()) return std::nullopt;
    pose = pose_update(pose, increment);
  }
  return pose;
}

std::optional<Pose> find_lost_pose(std::span<const ObservedPoint> observations, double threshold_sigmas,
                                   std::uint64_t seed) {
  RansacOptions sampling;
  sampling.threshold = threshold_sigmas;
  sampling.confidence = 0.999;
  sampling.max_draws = 500;
  sampling.seed = seed;
  const auto found = ransac(ObservedPointEstimator(observations), sampling);
  return found ? std::optional(found->model) : std::nullopt;
}

}  // namespace megablock
