#include "geometry/camera/models/thin_prism_fisheye.h"

#include <Eigen/LU>
#include <numbers>

namespace megablock {

namespace {

// The angle from the axis times the direction across it: (a, b).
Eigen::Vector2d equidistant(const Eigen::Vector3d& point) {
  const double radius = point.head<2>().norm();
  if (radius == 0) return Eigen::Vector2d::Zero();
  return (std::atan2(radius, point.z()) / radius) * point.head<2>();
}

bool unfolded(const Eigen::Matrix2d& jacobian) { return jacobian.determinant() > 0 && jacobian.trace() > 0; }

}  // namespace

std::vector<CameraParameter> ThinPrismFisheyeModel::parameters(int) {
  std::vector<CameraParameter> all = common_parameters();
  add_radial_terms(4, all);
  for (const char* name : {"p1", "p2", "sx1", "sy1"}) all.push_back({name, ParameterRole::kTangential});
  return all;
}

Eigen::Matrix2d ThinPrismFisheyeModel::distortion_jacobian(const double* k, const Eigen::Vector2d& equidistant) {
  const double a = equidistant.x(), b = equidistant.y(), r2 = equidistant.squaredNorm();
  const double g = 1 + r2 * (k[kK1] + r2 * (k[kK2] + r2 * (k[kK3] + r2 * k[kK4])));
  const double slope = k[kK1] + r2 * (2 * k[kK2] + r2 * (3 * k[kK3] + r2 * 4 * k[kK4]));  // d g / d r2
  const double cross = 2 * a * b * slope + 2 * k[kP1] * a + 2 * k[kP2] * b;
  Eigen::Matrix2d jacobian;
  jacobian << g + 2 * a * a * slope + 2 * k[kP1] * b + 6 * k[kP2] * a + 2 * k[kSx1] * a, cross + 2 * k[kSx1] * b,
      cross + 2 * k[kSy1] * a, g + 2 * b * b * slope + 6 * k[kP1] * b + 2 * k[kP2] * a + 2 * k[kSy1] * b;
  return jacobian;
}

bool ThinPrismFisheyeModel::sees(int, const double* k, const Eigen::Vector3d& point) {
  if (point.head<2>().norm() == 0) return point.z() > 0;
  return unfolded(distortion_jacobian(k, equidistant(point)));
}

// (a, b) = s (X, Y) with s = t / R; ds = (dt - s dR) / R and dt = (Z dR - R dZ) / |X|^2.
bool ThinPrismFisheyeModel::linearise(int order, const double* k, const Eigen::Vector3d& point,
                                      ProjectionJacobian& result) {
  const double radius = point.head<2>().norm(), f = k[kFocal];
  if (radius == 0) return PinholeModel::linearise(k, parameter_count(order), point, result);
  const Eigen::Vector2d ab = equidistant(point), direction = point.head<2>() / radius;
  const Eigen::Matrix2d jacobian = distortion_jacobian(k, ab);
  if (!unfolded(jacobian)) return false;
  const double s = ab.norm() / radius, squared = point.squaredNorm();
  Eigen::Matrix<double, 2, 3> by_point;  // of (a, b)
  by_point.leftCols<2>() = (point.z() / squared - s) * direction * direction.transpose();
  by_point.leftCols<2>().diagonal().array() += s;
  by_point.col(2) = -(radius / squared) * direction;
  const Eigen::Vector2d distorted = distort<double>(k, ab.x(), ab.y());
  result.pixel = Eigen::Vector2d(k[kPrincipalX], k[kPrincipalY]) + f * distorted;
  result.by_point = f * jacobian * by_point;
  result.by_intrinsics.setZero(2, parameter_count(order));
  result.by_intrinsics.leftCols<3>() << distorted.x(), 1, 0, distorted.y(), 0, 1;
  const double a = ab.x(), b = ab.y(), r2 = ab.squaredNorm();
  double power = r2;
  for (int p = kK1; p <= kK4; ++p, power *= r2) result.by_intrinsics.col(p) = f * power * ab;
  result.by_intrinsics.col(kP1) = f * Eigen::Vector2d(2 * a * b, r2 + 2 * b * b);
  result.by_intrinsics.col(kP2) = f * Eigen::Vector2d(r2 + 2 * a * a, 2 * a * b);
  result.by_intrinsics(0, kSx1) = result.by_intrinsics(1, kSy1) = f * r2;
  return true;
}

std::optional<Eigen::Vector3d> ThinPrismFisheyeModel::viewing_ray(int, const double* k, const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d target = in_focal_lengths(k, pixel);
  Eigen::Vector2d ab = target;
  if (ab.norm() > std::numbers::pi / 2) ab *= std::numbers::pi / 2 / ab.norm();
  constexpr int kMaxIterations = 50;
  for (int i = 0; i < kMaxIterations; ++i) {
    const Eigen::Matrix2d jacobian = distortion_jacobian(k, ab);
    if (!unfolded(jacobian)) return std::nullopt;
    const Eigen::Vector2d step = jacobian.inverse() * (target - distort<double>(k, ab.x(), ab.y()));
    ab += step;
    const double angle = ab.norm();
    if (!(angle <= std::numbers::pi)) return std::nullopt;
    if (step.norm() > 1e-13) continue;
    if (angle == 0) return Eigen::Vector3d(0, 0, 1);
    const double scale = std::sin(angle) / angle;
    return Eigen::Vector3d(scale * ab.x(), scale * ab.y(), std::cos(angle)).normalized();
  }
  return std::nullopt;
}

}  // namespace megablock
