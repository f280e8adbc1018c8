#include "geometry/vanishing/interpretation_plane.h"

#include <Eigen/Geometry>
#include <algorithm>

#include "geometry/camera/camera.h"
#include "geometry/estimation/gauss_helmert.h"
#include "geometry/transform/rotation.h"

namespace megablock {

namespace {

// v / |v| and its covariance.
AxisDirection unit_axis(const Eigen::Vector3d& v, const Eigen::Matrix3d& covariance) {
  const double norm = v.norm();
  const Eigen::Vector3d u = v / norm;
  const Eigen::Matrix3d j = (Eigen::Matrix3d::Identity() - u * u.transpose()) / norm;
  return {u, propagated(j, covariance)};
}

}  // namespace

PerspectiveCentre perspective_centre(int width, int height) {
  return {{0.5 * width, 0.5 * height}, static_cast<double>(std::max(width, height))};
}

InterpretationPlane interpretation_plane(const ImageLine& line, const PerspectiveCentre& from) {
  const ImageLine about = line_about(line, from.centre);
  const double distance = from.distance, s = std::hypot(distance, about.rho), s3 = s * s * s;
  const Eigen::Vector2d along = about.along(), across = about.across();
  Eigen::Matrix<double, 3, 2> j;
  j.col(0) << -distance / s * along, 0;
  j.col(1) << -distance * about.rho / s3 * across, -distance * distance / s3;
  InterpretationPlane plane;
  plane.normal << distance / s * across, -about.rho / s;
  plane.covariance = propagated(j, about.covariance);
  return plane;
}

std::optional<InterpretationPlane> interpretation_plane(const Eigen::Vector3d& a, const Eigen::Matrix3d& a_covariance,
                                                        const Eigen::Vector3d& b, const Eigen::Matrix3d& b_covariance) {
  const Eigen::Vector3d normal = a.cross(b);
  const double size = normal.norm();
  if (!(size > 1e-12 * a.norm() * b.norm()) || !std::isfinite(size)) return std::nullopt;
  const Eigen::Matrix3d by_a = -skew(b), by_b = skew(a);
  const AxisDirection unit = unit_axis(normal, propagated(by_a, a_covariance) + propagated(by_b, b_covariance));
  return InterpretationPlane{unit.direction, unit.covariance};
}

std::optional<InterpretationPlane> interpretation_plane(const ImageLine& line, const Intrinsics& camera) {
  const LinePoints points = independent_points(line);
  const RayJacobian a = ray_with_jacobian(camera, points.first), b = ray_with_jacobian(camera, points.second);
  if (!a.valid || !b.valid) return std::nullopt;
  const Eigen::Matrix2d covariance = points.sigma_px * points.sigma_px * Eigen::Matrix2d::Identity();
  return interpretation_plane(a.ray, propagated(a.by_pixel, covariance), b.ray, propagated(b.by_pixel, covariance));
}

AxisDirection seen_from(const AxisDirection& axis, const PerspectiveCentre& from, const PerspectiveCentre& to) {
  // Homogeneous coordinates of the vanishing point about the other centre.
  Eigen::Matrix3d map = Eigen::Matrix3d::Identity();
  map.topLeftCorner<2, 2>() *= from.distance;
  map.topRightCorner<2, 1>() = from.centre - to.centre;
  map(2, 2) = to.distance;
  return unit_axis(map * axis.direction, propagated(map, axis.covariance));
}

std::optional<ImagePoint> image_of(const AxisDirection& axis, const PerspectiveCentre& from) {
  const Eigen::Vector3d& v = axis.direction;
  const Eigen::Vector2d offset = from.distance / v.z() * v.head<2>();
  if (!offset.allFinite()) return std::nullopt;
  Eigen::Matrix<double, 2, 3> j;
  j << from.distance / v.z() * Eigen::Matrix2d::Identity(), -offset / v.z();
  return ImagePoint{from.centre + offset, propagated(j, axis.covariance)};
}

}  // namespace megablock
