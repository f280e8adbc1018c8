// Camera: intrinsics and projection of the Brown model (later models join this file's family).
//
//     x = X/Z, y = Y/Z, r2 = x^2 + y^2                          (camera coordinates, looking along +z, y down)
//     x_d = x (1 + k1 r2 + k2 r2^2 + k3 r2^3) + 2 p1 x y + p2 (r2 + 2 x^2)
//     y_d = y (1 + k1 r2 + k2 r2^2 + k3 r2^3) + p1 (r2 + 2 y^2) + 2 p2 x y
//     u = cx + f x_d,  v = cy + f y_d                           (pixels, pixel centres at +0.5)
//
// Distort direction (ground -> image), after Brown (1971), parameter order and signs as in OpenCV.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "geometry/intrinsics.h"

namespace megablock {

// Projects camera coordinates; Z > 0 is the caller's to check. Templated for automatic differentiation.
template <typename Scalar>
Eigen::Matrix<Scalar, 2, 1> project(const Scalar* k, const Eigen::Matrix<Scalar, 3, 1>& point) {
  const Scalar x = point.x() / point.z(), y = point.y() / point.z();
  const Scalar r2 = x * x + y * y;
  const Scalar radial = Scalar(1) + r2 * (k[kRadial1] + r2 * (k[kRadial2] + r2 * k[kRadial3]));
  const Scalar two_xy = Scalar(2) * x * y;
  const Scalar xd = x * radial + k[kDecentring1] * two_xy + k[kDecentring2] * (r2 + Scalar(2) * x * x);
  const Scalar yd = y * radial + k[kDecentring1] * (r2 + Scalar(2) * y * y) + k[kDecentring2] * two_xy;
  return {k[kPrincipalX] + k[kFocal] * xd, k[kPrincipalY] + k[kFocal] * yd};
}

inline Eigen::Vector2d project(const Intrinsics& k, const Eigen::Vector3d& point) {
  return project<double>(k.data(), point);
}

// Columns: the model's parameters. In place, without heap.
using IntrinsicJacobian = Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::ColMajor, 2, kMaxIntrinsics>;

// Projection with derivatives by camera coordinates and by the parameters.
struct ProjectionJacobian {
  Eigen::Vector2d pixel;
  Eigen::Matrix<double, 2, 3> by_point;
  IntrinsicJacobian by_intrinsics;
};
ProjectionJacobian project_with_jacobian(const Intrinsics& k, const Eigen::Vector3d& point);

// Inverse: the normalised image point (x, y) = (X/Z, Y/Z) of a pixel, by Newton iterations on the distortion.
// Empty where the model cannot be inverted (beyond the radius at which the radial polynomial turns back).
std::optional<Eigen::Vector2d> unproject(const Intrinsics& k, const Eigen::Vector2d& pixel);

// Unit viewing direction of a pixel in camera coordinates; empty as unproject.
std::optional<Eigen::Vector3d> viewing_ray(const Intrinsics& k, const Eigen::Vector2d& pixel);

}  // namespace megablock
