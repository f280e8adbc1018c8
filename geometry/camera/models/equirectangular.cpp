#include "geometry/camera/models/equirectangular.h"

#include <numbers>

namespace megablock {

std::vector<CameraParameter> EquirectangularModel::parameters(int) {
  std::vector<CameraParameter> all = common_parameters();
  all[kFocal].fixed = true;
  all[kPrincipalX].same_as_rotation = true;
  return all;
}

bool EquirectangularModel::sees(int, const double*, const Eigen::Vector3d& point) {
  constexpr double kNearestToPole = 1e-6;  // tangent of the angle from the pole
  return std::hypot(point.x(), point.z()) > kNearestToPole * std::abs(point.y());
}

bool EquirectangularModel::linearise(int order, const double* k, const Eigen::Vector3d& point,
                                     ProjectionJacobian& result) {
  if (!sees(order, k, point)) return false;
  const double f = k[kFocal], squared = point.x() * point.x() + point.z() * point.z(), h = std::sqrt(squared);
  const double all = point.squaredNorm();
  result.pixel = project<double>(order, k, point);
  result.by_point << f * point.z() / squared, 0, -f * point.x() / squared,  //
      -f * point.y() * point.x() / (h * all), f * h / all, -f * point.y() * point.z() / (h * all);
  result.by_intrinsics.resize(2, parameter_count(order));
  result.by_intrinsics << std::atan2(point.x(), point.z()), 1, 0, std::atan2(point.y(), h), 0, 1;
  return true;
}

std::optional<Eigen::Vector3d> EquirectangularModel::viewing_ray(int, const double* k, const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d angles = in_focal_lengths(k, pixel);
  const double across = angles.x(), down = angles.y();
  if (!(std::abs(down) < std::numbers::pi / 2) || !std::isfinite(across)) return std::nullopt;
  return Eigen::Vector3d(std::sin(across) * std::cos(down), std::sin(down), std::cos(across) * std::cos(down));
}

}  // namespace megablock
