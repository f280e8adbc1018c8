// Estimator of ransac.h for the pose of a camera, or of a rig of cameras, from points seen along rays.
//
//     ResectionEstimator      3 sights; angle between a ray and the direction to its point, points in front
//
// Rays of one projection centre make the three-point problem (p3p.h), others the generalised one (gp3p.h). Refined by
// Gauss-Newton on the differences of unit directions, with the weights 1 / (1 + 4 r^2 / t^2) up to 2 t.
#pragma once

#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <span>

#include "geometry/resection/gp3p.h"

namespace megablock {

struct RaySight {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  // projection centre in the rig
  Eigen::Vector3d direction;                         // unit, rig axes
  Eigen::Vector3d point;                             // ground frame
};

class ResectionEstimator {
 public:
  using Model = Pose;  // ground -> rig
  static constexpr std::size_t kSampleSize = 3;
  // The sights must outlive it. Those that are not numbers are no inliers.
  explicit ResectionEstimator(std::span<const RaySight> sights) : sights_(sights) {}
  std::size_t size() const { return sights_.size(); }
  Solutions<Pose, 8> solve(const std::array<std::size_t, 3>& rows) const;
  // Of the difference of the unit directions, which is an angle in radians where it is small.
  auto squared_residuals(const Pose& pose) const {
    return [sights = sights_, centre = pose.centre,
            rotation = Eigen::Matrix3d(pose.rotation.toRotationMatrix())](std::size_t i) {
      const RaySight& sight = sights[i];
      const Eigen::Vector3d inside = rotation * (sight.point - centre) - sight.origin;
      return (inside / inside.norm() - sight.direction).squaredNorm();
    };
  }
  std::optional<Pose> refine(const Pose& pose, double threshold) const { return adjusted(pose, threshold, 3); }
  // Ends earlier where the truncated squares do not fall any more.
  Pose adjusted(Pose pose, double threshold, int max_iterations) const;

 private:
  double cost(const Pose& pose, double threshold) const;
  std::span<const RaySight> sights_;
};

}  // namespace megablock
