#include "geometry/camera.h"

#include <Eigen/LU>
#include <cmath>

namespace megablock {

namespace {

// Distorted normalised coordinates with their derivatives by (x, y).
struct Distortion {
  Eigen::Vector2d point;
  Eigen::Matrix2d jacobian;
};

Distortion distort(const Intrinsics& k, double x, double y) {
  const double r2 = x * x + y * y;
  const double radial = 1 + r2 * (k[kRadial1] + r2 * (k[kRadial2] + r2 * k[kRadial3]));
  const double slope = k[kRadial1] + r2 * (2 * k[kRadial2] + 3 * r2 * k[kRadial3]);  // d radial / d r2
  const double p1 = k[kDecentring1], p2 = k[kDecentring2];
  Distortion d;
  d.point = {x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x), y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y};
  const double cross = 2 * x * y * slope + 2 * p1 * x + 2 * p2 * y;
  d.jacobian << radial + 2 * x * x * slope + 2 * p1 * y + 6 * p2 * x, cross,  //
      cross, radial + 2 * y * y * slope + 6 * p1 * y + 2 * p2 * x;
  return d;
}

}  // namespace

ProjectionJacobian project_with_jacobian(const Intrinsics& k, const Eigen::Vector3d& point) {
  const double inverse_z = 1 / point.z();
  const double x = point.x() * inverse_z, y = point.y() * inverse_z;
  const Distortion d = distort(k, x, y);
  const double f = k[kFocal];
  ProjectionJacobian result;
  result.pixel = {k[kPrincipalX] + f * d.point.x(), k[kPrincipalY] + f * d.point.y()};

  Eigen::Matrix<double, 2, 3> normalised;
  normalised << inverse_z, 0, -x * inverse_z, 0, inverse_z, -y * inverse_z;
  result.by_point.noalias() = f * d.jacobian * normalised;

  const double r2 = x * x + y * y, r4 = r2 * r2, r6 = r4 * r2;
  result.by_intrinsics.resize(2, k.size());
  result.by_intrinsics << d.point.x(), 1, 0, f * x * r2, f * x * r4, f * x * r6, f * 2 * x * y, f * (r2 + 2 * x * x),
      d.point.y(), 0, 1, f * y * r2, f * y * r4, f * y * r6, f * (r2 + 2 * y * y), f * 2 * x * y;
  return result;
}

std::optional<Eigen::Vector2d> unproject(const Intrinsics& k, const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d target((pixel.x() - k[kPrincipalX]) / k[kFocal], (pixel.y() - k[kPrincipalY]) / k[kFocal]);
  Eigen::Vector2d p = target;
  constexpr int kMaxIterations = 50;
  for (int i = 0; i < kMaxIterations; ++i) {
    const Distortion d = distort(k, p.x(), p.y());
    if (!(d.jacobian.determinant() > 0) || !(d.jacobian.trace() > 0)) return std::nullopt;
    const Eigen::Vector2d step = d.jacobian.inverse() * (target - d.point);
    p += step;
    if (!p.allFinite()) return std::nullopt;
    if (step.squaredNorm() < 1e-26 * (1 + p.squaredNorm())) return p;
  }
  return std::nullopt;
}

std::optional<Eigen::Vector3d> viewing_ray(const Intrinsics& k, const Eigen::Vector2d& pixel) {
  const auto p = unproject(k, pixel);
  if (!p) return std::nullopt;
  return Eigen::Vector3d(p->x(), p->y(), 1).normalized();
}

}  // namespace megablock
