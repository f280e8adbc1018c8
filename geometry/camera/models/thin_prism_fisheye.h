// Gives the fisheye with decentring and thin prisms, COLMAP's THIN_PRISM_FISHEYE (J. Weng, P. Cohen and M. Herniou,
// 1992, for the terms; applied to equidistant coordinates).
//
//     t = angle between ray and axis, R = |X, Y|,  a = t X/R, b = t Y/R,  r2 = a^2 + b^2 = t^2,
//     g = 1 + k1 r2 + k2 r2^2 + k3 r2^3 + k4 r2^4,
//     u = cx + f (a g + 2 p1 a b + p2 (r2 + 2 a^2) + sx1 r2)
//     v = cy + f (b g + p1 (r2 + 2 b^2) + 2 p2 a b + sy1 r2)
//
// It sees every direction in which the distortion does not fold, that is where its Jacobian is positive, also beyond 90
// degrees. With p1 = p2 = sx1 = sy1 = 0 it is the fisheye of fisheye.h.
#pragma once

#include <array>
#include <cmath>
#include <optional>

#include "geometry/camera/models/pinhole.h"

namespace megablock {

struct ThinPrismFisheyeModel {
  static constexpr const char* kName = "thin-prism-fisheye";
  static constexpr OrderRange kOrders{};
  static constexpr FieldOfView kField = FieldOfView::kWide;
  static constexpr bool kCorrectsPixels = false;
  static constexpr std::array kColmap = {
      ColmapModel{10, "THIN_PRISM_FISHEYE", "fx fy cx cy k1 k2 p1 p2 k3 k4 sx1 sy1"}};

  static constexpr int parameter_count(int) { return 11; }
  static std::vector<CameraParameter> parameters(int);

  template <typename Scalar>
  static PixelOf<Scalar> project(int, const Scalar* k, const PointOf<Scalar>& point) {
    using std::atan2;
    using std::sqrt;
    const Scalar squared = point.x() * point.x() + point.y() * point.y();
    if (!(squared > Scalar(0))) return PinholeModel::project<Scalar>(0, k, point);  // all terms vanish with a and b
    const Scalar radius = sqrt(squared), scale = atan2(radius, point.z()) / radius;
    const PixelOf<Scalar> d = distort<Scalar>(k, scale * point.x(), scale * point.y());
    return {k[kPrincipalX] + k[kFocal] * d.x(), k[kPrincipalY] + k[kFocal] * d.y()};
  }
  static bool sees(int, const double* k, const Eigen::Vector3d& point);
  static bool linearise(int, const double* k, const Eigen::Vector3d& point, ProjectionJacobian& result);
  // Inverts the distortion by Newton's method; then the angle is |a, b|.
  static std::optional<Eigen::Vector3d> viewing_ray(int, const double* k, const Eigen::Vector2d& pixel);

 private:
  enum Position { kK1 = kRadial1, kK2, kK3, kK4, kP1, kP2, kSx1, kSy1 };

  template <typename Scalar>
  static PixelOf<Scalar> distort(const Scalar* k, const Scalar& a, const Scalar& b) {
    const Scalar r2 = a * a + b * b, two_ab = Scalar(2) * a * b;
    const Scalar g = Scalar(1) + r2 * (k[kK1] + r2 * (k[kK2] + r2 * (k[kK3] + r2 * k[kK4])));
    return {a * g + k[kP1] * two_ab + k[kP2] * (r2 + Scalar(2) * a * a) + k[kSx1] * r2,
            b * g + k[kP1] * (r2 + Scalar(2) * b * b) + k[kP2] * two_ab + k[kSy1] * r2};
  }
  static Eigen::Matrix2d distortion_jacobian(const double* k, const Eigen::Vector2d& equidistant);
};

}  // namespace megablock
