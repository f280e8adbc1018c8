// Gives the equidistant fisheye of OpenCV (J. Kannala and S. Brandt, 2006).
//
//     t = angle between ray and axis, R = |X, Y|,  t_d = t (1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8),
//     u = cx + f t_d X/R,  v = cy + f t_d Y/R
//
// It sees every direction up to the angle where the polynomial stops growing, also beyond 90 degrees. Beyond that
// angle two directions would share a pixel.
#pragma once

#include <array>
#include <cmath>
#include <optional>

#include "geometry/camera/models/pinhole.h"

namespace megablock {

struct FisheyeModel {
  static constexpr const char* kName = "opencv-fisheye";
  static constexpr OrderRange kOrders{};
  static constexpr FieldOfView kField = FieldOfView::kWide;
  static constexpr bool kCorrectsPixels = false;
  static constexpr std::array kColmap = {ColmapModel{5, "OPENCV_FISHEYE", "fx fy cx cy k1 k2 k3 k4"},
                                         ColmapModel{8, "SIMPLE_RADIAL_FISHEYE", "f cx cy k1"},
                                         ColmapModel{9, "RADIAL_FISHEYE", "f cx cy k1 k2"}};

  static constexpr int parameter_count(int) { return 7; }
  static std::vector<CameraParameter> parameters(int);

  template <typename Scalar>
  static PixelOf<Scalar> project(int, const Scalar* k, const PointOf<Scalar>& point) {
    using std::atan2;
    using std::sqrt;
    const Scalar squared = point.x() * point.x() + point.y() * point.y();
    if (!(squared > Scalar(0))) return PinholeModel::project<Scalar>(0, k, point);
    const Scalar radius = sqrt(squared), angle = atan2(radius, point.z()), a2 = angle * angle;
    const Scalar* c = k + kRadial1;
    const Scalar distorted = angle * (Scalar(1) + a2 * (c[0] + a2 * (c[1] + a2 * (c[2] + a2 * c[3]))));
    const Scalar scale = k[kFocal] * distorted / radius;
    return {k[kPrincipalX] + scale * point.x(), k[kPrincipalY] + scale * point.y()};
  }
  static bool sees(int, const double* k, const Eigen::Vector3d& point);
  static bool linearise(int, const double* k, const Eigen::Vector3d& point, ProjectionJacobian& result);
  // Solves t_d(t) = r for the angle t by Newton's method, where r is the distance of the pixel from the principal point
  // in focal lengths.
  static std::optional<Eigen::Vector3d> viewing_ray(int, const double* k, const Eigen::Vector2d& pixel);
};

}  // namespace megablock
