#include "match/filter/match_errors.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace megablock {

MatchErrors match_errors(const Ray& a, const Ray& b, double focal_a_px, double focal_b_px) {
  constexpr double kFar = 1e4;  // metres; limit of the distances along nearly parallel rays
  const Eigen::Vector3d baseline = b.origin - a.origin, normal = a.direction.cross(b.direction);
  const double cosine = a.direction.dot(b.direction), sine = normal.norm();
  MatchErrors errors;
  errors.angle_rad = std::atan2(sine, cosine);
  const double along_a = baseline.dot(a.direction), along_b = baseline.dot(b.direction);
  if (sine < 1e-9) {  // parallel: the point is far away on both rays
    errors.distance_a_m = errors.distance_b_m = kFar;
    errors.ray_distance_m = baseline.cross(a.direction).norm();
  } else {
    errors.distance_a_m = std::clamp((along_a - cosine * along_b) / (sine * sine), -kFar, kFar);
    errors.distance_b_m = std::clamp((cosine * along_a - along_b) / (sine * sine), -kFar, kFar);
    errors.ray_distance_m = std::abs(baseline.dot(normal)) / sine;
  }
  // Squared length of the part of v perpendicular to a direction.
  const auto across = [](const Eigen::Vector3d& v, const Eigen::Vector3d& direction) {
    return (v - direction * direction.dot(v)).squaredNorm();
  };
  const double by_a = across(b.direction.cross(baseline), a.direction) / (focal_a_px * focal_a_px);
  const double by_b = across(baseline.cross(a.direction), b.direction) / (focal_b_px * focal_b_px);
  if (by_a + by_b > 0) errors.reprojection_px = std::abs(baseline.dot(normal)) / std::sqrt(by_a + by_b);
  return errors;
}

}  // namespace megablock
