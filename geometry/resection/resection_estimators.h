// Gives the estimator that ransac.h uses for the pose of a camera, or of a rig of cameras, from rays to known points.
//
//     ResectionEstimator      3 rays; residual: angle between a ray and the direction to its point
//
// Rays from one projection centre make the three-point problem (p3p.h), other rays the generalised one (gp3p.h). Local
// optimisation is Gauss-Newton on the differences of unit directions, with weights 1 / (1 + 4 r^2 / t^2) for residuals
// r up to 2 t, where t is the threshold: the weights suppress outliers, and the cut at 2 t still admits inliers that
// the minimal sample missed.
#pragma once

#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <span>

#include "geometry/resection/gp3p.h"

namespace megablock {

// One measured ray and the point it is directed to.
struct PointRay {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  // projection centre in the rig, metres
  Eigen::Vector3d direction;                         // unit vector, rig axes
  Eigen::Vector3d point;                             // ground frame, metres
};

class ResectionEstimator {
 public:
  using Model = Pose;  // ground -> rig
  static constexpr std::size_t kSampleSize = 3;
  // `rays` must outlive the estimator. Elements that are not finite never count as inliers.
  explicit ResectionEstimator(std::span<const PointRay> rays) : rays_(rays) {}
  std::size_t size() const { return rays_.size(); }
  Solutions<Pose, 8> solve(const std::array<std::size_t, 3>& rows) const;
  // Squared length of the difference of two unit directions; for small differences its root is the angle in radians.
  auto squared_residuals(const Pose& pose) const {
    return [rays = rays_, centre = pose.centre,
            rotation = Eigen::Matrix3d(pose.rotation.toRotationMatrix())](std::size_t i) {
      const PointRay& ray = rays[i];
      const Eigen::Vector3d inside = rotation * (ray.point - centre) - ray.origin;
      return (inside / inside.norm() - ray.direction).squaredNorm();
    };
  }
  std::optional<Pose> refine(const Pose& pose, double threshold) const { return adjusted(pose, threshold, 3); }
  // Gauss-Newton from `pose`, up to `max_iterations` iterations; ends earlier when the sum of truncated squares does
  // not fall.
  Pose adjusted(Pose pose, double threshold, int max_iterations) const;

 private:
  double cost(const Pose& pose, double threshold) const;
  std::span<const PointRay> rays_;
};

}  // namespace megablock
