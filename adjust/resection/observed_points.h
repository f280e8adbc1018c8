// Gives the whitened residuals of points observed by a rig, and the estimator of its pose for
// geometry/estimation/ransac.h.
//
// Residuals are in pixels (geometry/resection/rig_ray.h), each whitened by
//
//     image_sigma^2 I + J R C_X R' J'        (C_X: covariance of the point, J R: derivative by the point)
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>

#include "geometry/numbers/solutions.h"
#include "geometry/resection/rig_ray.h"

namespace megablock {

struct ObservedPoint {
  RigRay ray;
  Eigen::Vector3d point = Eigen::Vector3d::Zero();       // ground frame, metres
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // of the point, m^2
  double sigma_px = 0.5;                                 // of the observation, per axis
  std::int64_t id = 0;  // of the point; several observations of one point have the same id
};

// The whitened residual of an observation and its derivative by the pose.
struct WhitenedResidual {
  Eigen::Vector2d residual;
  Eigen::Matrix<double, 2, 6> by_pose;
  double squared_px;
};
// Empty where the point is not in front of the camera.
std::optional<WhitenedResidual> whitened(const ObservedPoint& observation, const Pose& pose, bool with_jacobian);

using PoseNormal = Eigen::Matrix<double, 6, 6>;
// Adds the normal equations of the observations whose squared residuals do not exceed the limit.
void add_normal_equations(std::span<const ObservedPoint> observations, const Pose& pose, double limit_squared,
                          PoseNormal& normal, PoseIncrement& right);

// Draws samples of three points (gp3p.h), and refines a pose by a few least squares iterations.
class ObservedPointEstimator {
 public:
  using Model = Pose;  // ground -> rig
  static constexpr std::size_t kSampleSize = 3;
  // The observations must outlive the object.
  explicit ObservedPointEstimator(std::span<const ObservedPoint> observations) : observations_(observations) {}
  std::size_t size() const { return observations_.size(); }
  Solutions<Pose, 8> solve(const std::array<std::size_t, 3>& rows) const;
  // Squares of the whitened residuals; infinite behind a camera.
  auto squared_residuals(const Pose& pose) const {
    return [observations = observations_, pose](std::size_t i) {
      const auto w = whitened(observations[i], pose, false);
      return w ? w->residual.squaredNorm() : std::numeric_limits<double>::infinity();
    };
  }
  std::optional<Pose> refine(Pose pose, double threshold) const;

 private:
  std::span<const ObservedPoint> observations_;
};

// Finds the pose with most inliers for a lost frame or a lost part of a tile, with up to 500 samples. Residuals up to
// the threshold, in sigmas, are inliers. Empty where no pose is found; the caller decides whether the inliers are
// enough.
std::optional<Pose> find_lost_pose(std::span<const ObservedPoint> observations, double threshold_sigmas,
                                   std::uint64_t seed);

}  // namespace megablock
