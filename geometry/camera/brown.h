// Brown's projection with its derivatives. It is inline, because most blocks use this model and loops over many
// observations call it. The formulas are in projection.h.
#pragma once

#include "geometry/camera/camera.h"

namespace megablock {

// Distorted normalised coordinates, with their derivatives by the undistorted (x, y).
struct BrownDistortion {
  Eigen::Vector2d point;
  Eigen::Matrix2d jacobian;
};
inline BrownDistortion distort_brown(const Intrinsics& k, double x, double y) {
  const double r2 = x * x + y * y;
  const double radial = 1 + r2 * (k[kRadial1] + r2 * (k[kRadial2] + r2 * k[kRadial3]));
  const double slope = k[kRadial1] + r2 * (2 * k[kRadial2] + 3 * r2 * k[kRadial3]);  // d radial / d r2
  const double p1 = k[kDecentring1], p2 = k[kDecentring2];
  BrownDistortion d;
  d.point = {x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x), y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y};
  const double cross = 2 * x * y * slope + 2 * p1 * x + 2 * p2 * y;
  d.jacobian << radial + 2 * x * x * slope + 2 * p1 * y + 6 * p2 * x, cross,  //
      cross, radial + 2 * y * y * slope + 6 * p1 * y + 2 * p2 * x;
  return d;
}

// As project_with_jacobian(). Leaves `by_intrinsics` untouched unless with_intrinsics is true. Returns false for a
// point behind the camera.
inline bool project_brown(const Intrinsics& k, const Eigen::Vector3d& point, bool with_intrinsics,
                          ProjectionJacobian& result) {
  if (!(point.z() > 0)) return false;
  const double inverse_z = 1 / point.z();
  const double x = point.x() * inverse_z, y = point.y() * inverse_z;
  const BrownDistortion d = distort_brown(k, x, y);
  const double f = k[kFocal];
  result.pixel = {k[kPrincipalX] + f * d.point.x(), k[kPrincipalY] + f * d.point.y()};
  result.by_point.leftCols<2>() = (f * inverse_z) * d.jacobian;
  // x and y depend on Z only by the quotients, so dx/dZ = -x/Z.
  result.by_point.col(2) = -x * result.by_point.col(0) - y * result.by_point.col(1);
  if (!with_intrinsics) return true;

  const double r2 = x * x + y * y, r4 = r2 * r2, r6 = r4 * r2, xy = 2 * x * y;
  result.by_intrinsics.resize(2, 8);
  Eigen::Map<Eigen::Matrix<double, 2, 8>>(result.by_intrinsics.data()) << d.point.x(), 1, 0, f * x * r2, f * x * r4,
      f * x * r6, f * xy, f * (r2 + 2 * x * x),  //
      d.point.y(), 0, 1, f * y * r2, f * y * r4, f * y * r6, f * (r2 + 2 * y * y), f * xy;
  return true;
}

}  // namespace megablock
