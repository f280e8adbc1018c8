// Gives the pinhole, an image without distortion.
//
//     u = cx + f X/Z,  v = cy + f Y/Z
#pragma once

#include <array>
#include <optional>

#include "geometry/camera/models/model.h"

namespace megablock {

struct PinholeModel {
  static constexpr const char* kName = "pinhole";
  static constexpr OrderRange kOrders{};
  static constexpr FieldOfView kField = FieldOfView::kFront;
  static constexpr bool kCorrectsPixels = false;
  static constexpr std::array kColmap = {ColmapModel{1, "PINHOLE", "fx fy cx cy"},
                                         ColmapModel{0, "SIMPLE_PINHOLE", "f cx cy"}};

  static constexpr int parameter_count(int) { return 3; }
  static std::vector<CameraParameter> parameters(int) { return common_parameters(); }

  template <typename Scalar>
  static PixelOf<Scalar> project(int, const Scalar* k, const PointOf<Scalar>& point) {
    return {k[kPrincipalX] + k[kFocal] * (point.x() / point.z()), k[kPrincipalY] + k[kFocal] * (point.y() / point.z())};
  }
  static bool sees(int, const double*, const Eigen::Vector3d& point) { return point.z() > 0; }
  static bool linearise(int order, const double* k, const Eigen::Vector3d& point, ProjectionJacobian& result) {
    return linearise(k, parameter_count(order), point, result);
  }
  // The same for a model of `count` parameters; the columns of those behind f, cx and cy are zero.
  static bool linearise(const double* k, int count, const Eigen::Vector3d& point, ProjectionJacobian& result) {
    if (!(point.z() > 0)) return false;
    const double x = point.x() / point.z(), y = point.y() / point.z(), scale = k[kFocal] / point.z();
    result.pixel = project<double>(0, k, point);
    result.by_point << scale, 0, -scale * x, 0, scale, -scale * y;
    result.by_intrinsics.setZero(2, count);
    result.by_intrinsics.leftCols<3>() << x, 1, 0, y, 0, 1;
    return true;
  }
  static std::optional<Eigen::Vector2d> normalised(int, const double* k, const Eigen::Vector2d& pixel) {
    if (!pixel.allFinite()) return std::nullopt;
    return in_focal_lengths(k, pixel);
  }
};

}  // namespace megablock
