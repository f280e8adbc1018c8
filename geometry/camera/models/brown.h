// Gives Brown's model of radial and decentring distortion (D. C. Brown, 1971), with OpenCV's order and signs of
// parameters, and affinity and skew of the pixels as Metashape and Fraser (1997, "Digital camera self-calibration")
// have them.
//
//     x = X/Z, y = Y/Z,  r2 = x^2 + y^2,
//     x' = x (1 + k1 r2 + k2 r2^2 + k3 r2^3) + 2 p1 x y + p2 (r2 + 2 x^2)
//     y' = y (1 + k1 r2 + k2 r2^2 + k3 r2^3) + p1 (r2 + 2 y^2) + 2 p2 x y
//     u = cx + (f + b1) x' + b2 y'
//     v = cy + f y'
//
// b1 and b2 are in pixels. A camera with two focal lengths has fx = f + b1 and fy = f. With b1 = b2 = 0 every operation
// gives the bits of the formula without them.
//
// The derivatives are inline, because most blocks use this model and loops over many observations call them.
#pragma once

#include <array>
#include <optional>

#include "geometry/camera/models/model.h"

namespace megablock {

struct BrownModel {
  static constexpr const char* kName = "brown";
  static constexpr OrderRange kOrders{};
  static constexpr FieldOfView kField = FieldOfView::kFront;
  static constexpr bool kCorrectsPixels = false;
  static constexpr std::array kColmap = {
      ColmapModel{4, "OPENCV", "fx fy cx cy k1 k2 p1 p2"},
      ColmapModel{6, "FULL_OPENCV", "fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6"},
      ColmapModel{2, "SIMPLE_RADIAL", "f cx cy k1"},
      ColmapModel{3, "RADIAL", "f cx cy k1 k2"},
  };

  static constexpr int parameter_count(int) { return 10; }
  static std::vector<CameraParameter> parameters(int);

  template <typename Scalar>
  static PixelOf<Scalar> project(int, const Scalar* k, const PointOf<Scalar>& point);
  static bool sees(int, const double*, const Eigen::Vector3d& point) { return point.z() > 0; }
  static bool linearise(int, const double* k, const Eigen::Vector3d& point, ProjectionJacobian& result) {
    return linearise(k, point, true, result);
  }
  // The same; leaves `by_intrinsics` untouched unless with_intrinsics is true.
  static bool linearise(const double* k, const Eigen::Vector3d& point, bool with_intrinsics,
                        ProjectionJacobian& result);
  // By Newton's method. Empty beyond the radius where the distortion folds, that is where its Jacobian is no longer
  // positive.
  static std::optional<Eigen::Vector2d> normalised(int, const double* k, const Eigen::Vector2d& pixel);

  // Distorted normalised coordinates (x', y'), with their derivatives by the undistorted (x, y).
  struct Distortion {
    Eigen::Vector2d point;
    Eigen::Matrix2d jacobian;
  };
  static Distortion distort(const double* k, double x, double y);
};

template <typename Scalar>
PixelOf<Scalar> BrownModel::project(int, const Scalar* k, const PointOf<Scalar>& point) {
  const Scalar x = point.x() / point.z(), y = point.y() / point.z();
  const Scalar r2 = x * x + y * y;
  const Scalar radial = Scalar(1) + r2 * (k[kRadial1] + r2 * (k[kRadial2] + r2 * k[kRadial3]));
  const Scalar two_xy = Scalar(2) * x * y;
  const Scalar xd = x * radial + k[kDecentring1] * two_xy + k[kDecentring2] * (r2 + Scalar(2) * x * x);
  const Scalar yd = y * radial + k[kDecentring1] * (r2 + Scalar(2) * y * y) + k[kDecentring2] * two_xy;
  return {k[kPrincipalX] + ((k[kFocal] + k[kAffinity]) * xd + k[kSkew] * yd), k[kPrincipalY] + k[kFocal] * yd};
}

inline BrownModel::Distortion BrownModel::distort(const double* k, double x, double y) {
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

inline bool BrownModel::linearise(const double* k, const Eigen::Vector3d& point, bool with_intrinsics,
                                  ProjectionJacobian& result) {
  if (!(point.z() > 0)) return false;
  const double inverse_z = 1 / point.z();
  const double x = point.x() * inverse_z, y = point.y() * inverse_z;
  const Distortion d = distort(k, x, y);
  const double f = k[kFocal], fx = f + k[kAffinity], skew = k[kSkew];
  result.pixel = {k[kPrincipalX] + (fx * d.point.x() + skew * d.point.y()), k[kPrincipalY] + f * d.point.y()};
  result.by_point.row(0).head<2>() = (fx * inverse_z) * d.jacobian.row(0) + (skew * inverse_z) * d.jacobian.row(1);
  result.by_point.row(1).head<2>() = (f * inverse_z) * d.jacobian.row(1);
  // x and y depend on Z only by the quotients, so dx/dZ = -x/Z.
  result.by_point.col(2) = -x * result.by_point.col(0) - y * result.by_point.col(1);
  if (!with_intrinsics) return true;

  const double r2 = x * x + y * y, r4 = r2 * r2, r6 = r4 * r2, xy = 2 * x * y;
  result.by_intrinsics.resize(2, 10);
  Eigen::Map<Eigen::Matrix<double, 2, 10>>(result.by_intrinsics.data()) << d.point.x(), 1, 0,
      fx * x * r2 + skew * y * r2, fx * x * r4 + skew * y * r4, fx * x * r6 + skew * y * r6,
      fx * xy + skew * (r2 + 2 * y * y), fx * (r2 + 2 * x * x) + skew * xy, d.point.x(), d.point.y(),  //
      d.point.y(), 0, 1, f * y * r2, f * y * r4, f * y * r6, f * (r2 + 2 * y * y), f * xy, 0, 0;
  return true;
}

}  // namespace megablock
