#include "geometry/camera/models/fisheye.h"

#include <algorithm>
#include <numbers>

namespace megablock {

namespace {

// The distorted angle t_d(t) and its derivative t_d'.
struct Angle {
  double value, slope;
};
Angle distort_angle(const double* k, double angle) {
  const double a2 = angle * angle;
  const double* c = k + kRadial1;
  return {angle * (1 + a2 * (c[0] + a2 * (c[1] + a2 * (c[2] + a2 * c[3])))),
          1 + a2 * (3 * c[0] + a2 * (5 * c[1] + a2 * (7 * c[2] + a2 * 9 * c[3])))};
}

}  // namespace

std::vector<CameraParameter> FisheyeModel::parameters(int) {
  std::vector<CameraParameter> all = common_parameters();
  add_radial_terms(4, all);
  return all;
}

bool FisheyeModel::sees(int, const double* k, const Eigen::Vector3d& point) {
  const double radius = point.head<2>().norm();
  if (radius == 0) return point.z() > 0;
  return distort_angle(k, std::atan2(radius, point.z())).slope > 0;
}

// With s = t_d / R the pixel is c + f s (X, Y). Its derivatives follow from ds = (t_d' dt - s dR) / R and dt = (Z
// dR - R dZ) / |X|^2.
bool FisheyeModel::linearise(int order, const double* k, const Eigen::Vector3d& point, ProjectionJacobian& result) {
  const double radius = point.head<2>().norm(), f = k[kFocal];
  const int count = parameter_count(order);
  if (radius == 0) return PinholeModel::linearise(k, count, point, result);
  const double angle = std::atan2(radius, point.z());
  const Angle distorted = distort_angle(k, angle);
  if (!(distorted.slope > 0)) return false;
  const Eigen::Vector2d direction = point.head<2>() / radius;
  const double s = distorted.value / radius, turn = distorted.slope / point.squaredNorm();
  const double by_radius = (turn * point.z() - s) / radius;
  result.pixel = project<double>(order, k, point);
  result.by_point.leftCols<2>() = f * (by_radius * radius) * direction * direction.transpose();
  result.by_point.leftCols<2>().diagonal().array() += f * s;
  result.by_point.col(2) = -f * turn * radius * direction;
  result.by_intrinsics.resize(2, count);
  result.by_intrinsics.leftCols<3>() << distorted.value * direction.x(), 1, 0, distorted.value * direction.y(), 0, 1;
  double power = angle * angle * angle;
  for (int p = kRadial1; p < count; ++p, power *= angle * angle) result.by_intrinsics.col(p) = f * power * direction;
  return true;
}

std::optional<Eigen::Vector3d> FisheyeModel::viewing_ray(int, const double* k, const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d image = in_focal_lengths(k, pixel);
  const double radius = image.norm();
  if (radius == 0) return Eigen::Vector3d(0, 0, 1);
  double angle = std::min(radius, std::numbers::pi / 2);
  constexpr int kMaxIterations = 50;
  for (int i = 0; i < kMaxIterations; ++i) {
    const Angle distorted = distort_angle(k, angle);
    if (!(distorted.slope > 0)) return std::nullopt;
    const double step = (radius - distorted.value) / distorted.slope;
    angle += step;
    if (!(angle > 0 && angle <= std::numbers::pi)) return std::nullopt;
    if (std::abs(step) > 1e-13) continue;
    const double sine = std::sin(angle) / radius;
    return Eigen::Vector3d(sine * image.x(), sine * image.y(), std::cos(angle)).normalized();
  }
  return std::nullopt;
}

}  // namespace megablock
