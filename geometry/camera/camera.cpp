#include "geometry/camera/camera.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <numbers>

#include "geometry/camera/brown.h"

namespace megablock {

namespace {

using Kind = CameraModelKind;

// Projection without distortion. The columns of further parameters are zero.
bool pinhole_jacobian(const Intrinsics& k, const Eigen::Vector3d& point, ProjectionJacobian& result) {
  if (!(point.z() > 0)) return false;
  const double x = point.x() / point.z(), y = point.y() / point.z(), scale = k[kFocal] / point.z();
  result.pixel = projection::pinhole(k.data(), point);
  result.by_point << scale, 0, -scale * x, 0, scale, -scale * y;
  result.by_intrinsics.setZero(2, k.size());
  result.by_intrinsics.leftCols<3>() << x, 1, 0, y, 0, 1;
  return true;
}

// The fisheye's distorted angle t_d(t) and its derivative t_d'.
struct Angle {
  double value, slope;
};
Angle distort_angle(const Intrinsics& k, double angle) {
  const double a2 = angle * angle;
  const double* c = k.data() + kRadial1;
  return {angle * (1 + a2 * (c[0] + a2 * (c[1] + a2 * (c[2] + a2 * c[3])))),
          1 + a2 * (3 * c[0] + a2 * (5 * c[1] + a2 * (7 * c[2] + a2 * 9 * c[3])))};
}

// Whether the polynomial still grows at this angle; beyond, two angles would share a pixel.
bool fisheye_sees(const Intrinsics& k, const Eigen::Vector3d& point) {
  const double radius = point.head<2>().norm();
  if (radius == 0) return point.z() > 0;
  return distort_angle(k, std::atan2(radius, point.z())).slope > 0;
}

// With s = t_d / R the pixel is c + f s (X, Y). Its derivatives follow from ds = (t_d' dt - s dR) / R and dt = (Z
// dR - R dZ) / |X|^2.
bool fisheye_jacobian(const Intrinsics& k, const Eigen::Vector3d& point, ProjectionJacobian& result) {
  const double radius = point.head<2>().norm(), f = k[kFocal];
  if (radius == 0) return pinhole_jacobian(k, point, result);
  const double angle = std::atan2(radius, point.z());
  const Angle distorted = distort_angle(k, angle);
  if (!(distorted.slope > 0)) return false;
  const Eigen::Vector2d direction = point.head<2>() / radius;
  const double s = distorted.value / radius, turn = distorted.slope / point.squaredNorm();
  const double by_radius = (turn * point.z() - s) / radius;
  result.pixel = projection::fisheye(k.data(), point);
  result.by_point.leftCols<2>() = f * (by_radius * radius) * direction * direction.transpose();
  result.by_point.leftCols<2>().diagonal().array() += f * s;
  result.by_point.col(2) = -f * turn * radius * direction;
  result.by_intrinsics.resize(2, k.size());
  result.by_intrinsics.leftCols<3>() << distorted.value * direction.x(), 1, 0, distorted.value * direction.y(), 0, 1;
  double power = angle * angle * angle;
  for (int p = kRadial1; p < k.size(); ++p, power *= angle * angle) result.by_intrinsics.col(p) = f * power * direction;
  return true;
}

// A pole of a panorama is a whole line of pixels. Points closer to it than this (tangent of the angle) have no pixel.
constexpr double kNearestToPole = 1e-6;

bool panorama_sees(const Eigen::Vector3d& point) {
  return std::hypot(point.x(), point.z()) > kNearestToPole * std::abs(point.y());
}

bool panorama_jacobian(const Intrinsics& k, const Eigen::Vector3d& point, ProjectionJacobian& result) {
  if (!panorama_sees(point)) return false;
  const double f = k[kFocal], squared = point.x() * point.x() + point.z() * point.z(), h = std::sqrt(squared);
  const double all = point.squaredNorm();
  result.pixel = projection::equirectangular(k.data(), point);
  result.by_point << f * point.z() / squared, 0, -f * point.x() / squared,  //
      -f * point.y() * point.x() / (h * all), f * h / all, -f * point.y() * point.z() / (h * all);
  result.by_intrinsics.resize(2, k.size());
  result.by_intrinsics << std::atan2(point.x(), point.z()), 1, 0, std::atan2(point.y(), h), 0, 1;
  return true;
}

// Derivatives by the implicit function theorem, from those of the projection without distortion (see the head of
// correction.h).
bool corrected_jacobian(const Intrinsics& k, const Eigen::Vector3d& point, ProjectionJacobian& result) {
  if (!pinhole_jacobian(k, point, result)) return false;
  result.pixel = solve_correction(k, result.pixel);
  if (!result.pixel.allFinite()) return false;
  const Correction c = correction_with_jacobian(k, result.pixel);
  const Eigen::Matrix2d inverse = (Eigen::Matrix2d::Identity() + c.by_pixel).inverse();
  result.by_point = (inverse * result.by_point).eval();
  result.by_intrinsics = (inverse * (result.by_intrinsics - c.by_parameters)).eval();
  return true;
}

// Inverts Brown's distortion by Newton's method. Empty beyond the radius where the distortion folds, that is where its
// Jacobian is no longer positive.
std::optional<Eigen::Vector2d> unproject_brown(const Intrinsics& k, const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d target((pixel.x() - k[kPrincipalX]) / k[kFocal], (pixel.y() - k[kPrincipalY]) / k[kFocal]);
  Eigen::Vector2d p = target;
  constexpr int kMaxIterations = 50;
  for (int i = 0; i < kMaxIterations; ++i) {
    const BrownDistortion d = distort_brown(k, p.x(), p.y());
    if (!(d.jacobian.determinant() > 0) || !(d.jacobian.trace() > 0)) return std::nullopt;
    const Eigen::Vector2d step = d.jacobian.inverse() * (target - d.point);
    p += step;
    if (!p.allFinite()) return std::nullopt;
    if (step.squaredNorm() < 1e-26 * (1 + p.squaredNorm())) return p;
  }
  return std::nullopt;
}

// The normalised image point of a pixel without distortion.
std::optional<Eigen::Vector2d> unproject_pinhole(const Intrinsics& k, const Eigen::Vector2d& pixel) {
  if (!pixel.allFinite()) return std::nullopt;
  return Eigen::Vector2d((pixel.x() - k[kPrincipalX]) / k[kFocal], (pixel.y() - k[kPrincipalY]) / k[kFocal]);
}

// Solves t_d(t) = r for the angle t by Newton's method, where r is the distance of the pixel from the principal point
// in focal lengths.
std::optional<Eigen::Vector3d> fisheye_ray(const Intrinsics& k, const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d image((pixel.x() - k[kPrincipalX]) / k[kFocal], (pixel.y() - k[kPrincipalY]) / k[kFocal]);
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

std::optional<Eigen::Vector3d> panorama_ray(const Intrinsics& k, const Eigen::Vector2d& pixel) {
  const double across = (pixel.x() - k[kPrincipalX]) / k[kFocal], down = (pixel.y() - k[kPrincipalY]) / k[kFocal];
  if (!(std::abs(down) < std::numbers::pi / 2) || !std::isfinite(across)) return std::nullopt;
  return Eigen::Vector3d(std::sin(across) * std::cos(down), std::sin(down), std::cos(across) * std::cos(down));
}

}  // namespace

Eigen::Vector2d project_other(const Intrinsics& k, const Eigen::Vector3d& point) {
  switch (k.model().kind) {
    case Kind::kFisheye:
      return fisheye_sees(k, point) ? projection::fisheye(k.data(), point) : no_pixel();
    case Kind::kEquirectangular:
      return panorama_sees(point) ? projection::equirectangular(k.data(), point) : no_pixel();
    default:
      if (!(point.z() > 0)) return no_pixel();
      const Eigen::Vector2d pixel = projection::pinhole(k.data(), point);
      return corrects_pixels(k.model()) ? solve_correction(k, pixel) : pixel;
  }
}

namespace {

bool linearise(const Intrinsics& k, const Eigen::Vector3d& point, ProjectionJacobian& result) {
  switch (k.model().kind) {
    case Kind::kBrown:
      return project_brown(k, point, true, result);
    case Kind::kPinhole:
      return pinhole_jacobian(k, point, result);
    case Kind::kFisheye:
      return fisheye_jacobian(k, point, result);
    case Kind::kEquirectangular:
      return panorama_jacobian(k, point, result);
    default:
      return corrected_jacobian(k, point, result);
  }
}

}  // namespace

ProjectionJacobian project_with_jacobian(const Intrinsics& k, const Eigen::Vector3d& point) {
  ProjectionJacobian result;
  result.valid = linearise(k, point, result);
  return result;
}

std::optional<Eigen::Vector2d> unproject(const Intrinsics& k, const Eigen::Vector2d& pixel) {
  switch (k.model().kind) {
    case Kind::kBrown:
      return unproject_brown(k, pixel);
    case Kind::kPinhole:
      return unproject_pinhole(k, pixel);
    case Kind::kFisheye:
    case Kind::kEquirectangular: {
      const auto ray = viewing_ray(k, pixel);
      if (!ray || !(ray->z() > 0)) return std::nullopt;
      return Eigen::Vector2d(ray->x() / ray->z(), ray->y() / ray->z());
    }
    default:
      const Correction c = correction_at(k, pixel);
      if (!keeps_orientation(c)) return std::nullopt;
      return unproject_pinhole(k, pixel + c.value);
  }
}

std::optional<Eigen::Vector3d> viewing_ray(const Intrinsics& k, const Eigen::Vector2d& pixel) {
  if (k.model().kind == Kind::kFisheye) return fisheye_ray(k, pixel);
  if (k.model().kind == Kind::kEquirectangular) return panorama_ray(k, pixel);
  const auto p = unproject(k, pixel);
  if (!p) return std::nullopt;
  return Eigen::Vector3d(p->x(), p->y(), 1).normalized();
}

Eigen::Matrix<double, 3, 2> tangent_plane(const Eigen::Vector3d& direction) {
  Eigen::Matrix<double, 3, 2> basis;
  basis.col(0) = direction.unitOrthogonal();
  basis.col(1) = direction.cross(basis.col(0));
  return basis;
}

RayJacobian ray_with_jacobian(const Intrinsics& k, const Eigen::Vector2d& pixel) {
  RayJacobian result;
  const auto ray = viewing_ray(k, pixel);
  if (!ray) return result;
  const ProjectionJacobian projection = project_with_jacobian(k, *ray);
  if (!projection.valid) return result;
  const Eigen::Matrix<double, 3, 2> tangent = tangent_plane(*ray);
  const Eigen::Matrix2d by_tangent = projection.by_point * tangent;
  result.ray = *ray;
  result.by_pixel = tangent * by_tangent.inverse();
  result.by_intrinsics = -result.by_pixel * projection.by_intrinsics;
  result.valid = result.by_pixel.allFinite();
  return result;
}

}  // namespace megablock
