// Gives the model of a stitched panorama: columns are azimuths, rows are elevations.
//
//     u = cx + f atan2(X, Z),  v = cy + f atan2(Y, |X, Z|),  f = width / 2 pi
//
// It sees everything except its poles, each of which is a whole line of pixels. A change of cx has the same effect as a
// rotation of the camera about its vertical axis.
#pragma once

#include <array>
#include <cmath>
#include <optional>

#include "geometry/camera/models/model.h"

namespace megablock {

struct EquirectangularModel {
  static constexpr const char* kName = "equirectangular";
  static constexpr OrderRange kOrders{};
  static constexpr FieldOfView kField = FieldOfView::kPanorama;
  static constexpr bool kCorrectsPixels = false;
  static constexpr std::array<ColmapModel, 0> kColmap{};

  static constexpr int parameter_count(int) { return 3; }
  static std::vector<CameraParameter> parameters(int);

  template <typename Scalar>
  static PixelOf<Scalar> project(int, const Scalar* k, const PointOf<Scalar>& point) {
    using std::atan2;
    using std::sqrt;
    const Scalar horizontal = sqrt(point.x() * point.x() + point.z() * point.z());
    return {k[kPrincipalX] + k[kFocal] * atan2(point.x(), point.z()),
            k[kPrincipalY] + k[kFocal] * atan2(point.y(), horizontal)};
  }
  static bool sees(int, const double* k, const Eigen::Vector3d& point);
  static bool linearise(int, const double* k, const Eigen::Vector3d& point, ProjectionJacobian& result);
  static std::optional<Eigen::Vector3d> viewing_ray(int, const double* k, const Eigen::Vector2d& pixel);
};

}  // namespace megablock
