// Projection of the models that go from the ground to the image, as templates for automatic differentiation. Camera
// axes are x right, y down, z along the view; pixels have their centres at +0.5.
//
//     pinhole          u = cx + f x,  v = cy + f y,  x = X/Z, y = Y/Z
//     brown            r2 = x^2 + y^2,
//                      u = cx + f (x (1 + k1 r2 + k2 r2^2 + k3 r2^3) + 2 p1 x y + p2 (r2 + 2 x^2))
//                      v = cy + f (y (1 + k1 r2 + k2 r2^2 + k3 r2^3) + p1 (r2 + 2 y^2) + 2 p2 x y)
//     opencv-fisheye   t = angle between ray and axis, R = |X, Y|, t_d = t (1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8),
//                      u = cx + f t_d X/R,  v = cy + f t_d Y/R
//     equirectangular  u = cx + f atan2(X, Z),  v = cy + f atan2(Y, |X, Z|),  f = width / 2 pi
//
// Brown's model (D. C. Brown, 1971) has OpenCV's order and signs of parameters. The fisheye is that of OpenCV (J.
// Kannala and S. Brandt, 2006).
#pragma once

#include <Eigen/Core>
#include <cmath>

#include "geometry/camera/intrinsics.h"

namespace megablock {

namespace projection {

template <typename Scalar>
using Pixel = Eigen::Matrix<Scalar, 2, 1>;
template <typename Scalar>
using Point = Eigen::Matrix<Scalar, 3, 1>;

template <typename Scalar>
Pixel<Scalar> pinhole(const Scalar* k, const Point<Scalar>& point) {
  return {k[kPrincipalX] + k[kFocal] * (point.x() / point.z()), k[kPrincipalY] + k[kFocal] * (point.y() / point.z())};
}

template <typename Scalar>
Pixel<Scalar> brown(const Scalar* k, const Point<Scalar>& point) {
  const Scalar x = point.x() / point.z(), y = point.y() / point.z();
  const Scalar r2 = x * x + y * y;
  const Scalar radial = Scalar(1) + r2 * (k[kRadial1] + r2 * (k[kRadial2] + r2 * k[kRadial3]));
  const Scalar two_xy = Scalar(2) * x * y;
  const Scalar xd = x * radial + k[kDecentring1] * two_xy + k[kDecentring2] * (r2 + Scalar(2) * x * x);
  const Scalar yd = y * radial + k[kDecentring1] * (r2 + Scalar(2) * y * y) + k[kDecentring2] * two_xy;
  return {k[kPrincipalX] + k[kFocal] * xd, k[kPrincipalY] + k[kFocal] * yd};
}

template <typename Scalar>
Pixel<Scalar> fisheye(const Scalar* k, const Point<Scalar>& point) {
  using std::atan2;
  using std::sqrt;
  const Scalar squared = point.x() * point.x() + point.y() * point.y();
  if (!(squared > Scalar(0))) return pinhole(k, point);
  const Scalar radius = sqrt(squared), angle = atan2(radius, point.z()), a2 = angle * angle;
  const Scalar* c = k + kRadial1;
  const Scalar distorted = angle * (Scalar(1) + a2 * (c[0] + a2 * (c[1] + a2 * (c[2] + a2 * c[3]))));
  const Scalar scale = k[kFocal] * distorted / radius;
  return {k[kPrincipalX] + scale * point.x(), k[kPrincipalY] + scale * point.y()};
}

template <typename Scalar>
Pixel<Scalar> equirectangular(const Scalar* k, const Point<Scalar>& point) {
  using std::atan2;
  using std::sqrt;
  const Scalar horizontal = sqrt(point.x() * point.x() + point.z() * point.z());
  return {k[kPrincipalX] + k[kFocal] * atan2(point.x(), point.z()),
          k[kPrincipalY] + k[kFocal] * atan2(point.y(), horizontal)};
}

}  // namespace projection

// The pixel of a point that the model can project (see camera.h), for all models except those of correction.h.
template <typename Scalar>
Eigen::Matrix<Scalar, 2, 1> project_directly(CameraModelKind kind, const Scalar* k,
                                             const Eigen::Matrix<Scalar, 3, 1>& point) {
  switch (kind) {
    case CameraModelKind::kFisheye:
      return projection::fisheye(k, point);
    case CameraModelKind::kEquirectangular:
      return projection::equirectangular(k, point);
    case CameraModelKind::kPinhole:
      return projection::pinhole(k, point);
    default:
      return projection::brown(k, point);
  }
}

}  // namespace megablock
