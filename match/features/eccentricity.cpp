// Derives the correction. Let u be coordinates in the tangent plane of the unit sphere at the ray of the keypoint, and
// y = A u + 1/2 B(u, u) the image coordinates of u, to second order. A neighbourhood that would give the image I0(y)
// under y = A u alone gives
//
//     I(y) = I0(y - Q(y)),   Q_i(y) = y' S_i y,   S_i = 1/2 A^-T B_i A^-1.
//
// The detector takes the extremum of L * I, where L is the Laplacian of a Gaussian of variance t, instead of the
// extremum of L * I0, which lies at 0. To first order the extremum moves by d with
//
//     d_j = int (Q . grad I0) d_j L / int d_j I0 d_j L.
//
// About I0 only one thing is known: it gives the extremal response of L at 0. The mean over white textures under this
// condition is proportional to L itself. (For textures with the power 1/frequency^2 it is a Gaussian, and the result
// 3/4 of the following one; for a disc of the scale it is 3/2.) With I0 = L the integrals give
//
//     d_i = t/3 (sum_k (S_i)_kk + 2 sum_k (S_k)_ki),
//
// In a perspective image with the principal distance f, for a ray at the angle a from the axis, this is 4/3 t sin(a)
// cos(a) / f, outwards.
#include "match/features/eccentricity.h"

#include <array>

#include "geometry/camera/camera.h"
#include "io/block/tracks.h"

namespace megablock {

namespace {

// Variance of the Laplacian that is closest to OpenCV's difference of Gaussians, from the keypoint's diameter d. The
// narrow Gaussian has sigma = d / 2, the wide one 2^(1/3) times that.
double kernel_variance(double diameter_px) {
  constexpr double kRatioSquared = 1.5874010519681994;  // 2^(2/3)
  return diameter_px * diameter_px / 4 * (1 + kRatioSquared) / 2;
}

}  // namespace

Eigen::Vector2d eccentricity_px(const Intrinsics& intrinsics, const Eigen::Vector2d& pixel, double diameter_px) {
  const auto ray = viewing_ray(intrinsics, pixel);
  if (!ray) return Eigen::Vector2d::Zero();
  const Eigen::Matrix<double, 3, 2> tangent = tangent_plane(*ray);
  const ProjectionJacobian centre = project_with_jacobian(intrinsics, *ray);
  const Eigen::Matrix2d to_plane = (centre.by_point * tangent).inverse();  // A^-1
  if (!centre.valid || !to_plane.allFinite()) return Eigen::Vector2d::Zero();

  constexpr double kStep = 1e-4;                // radians
  std::array<Eigen::Matrix2d, 2> by_direction;  // [k](i, j) = (B_i)_jk
  // Second derivatives B by central differences of the projection's Jacobian.
  for (int k = 0; k < 2; ++k) {
    const ProjectionJacobian after = project_with_jacobian(intrinsics, *ray + kStep * tangent.col(k)),
                             before = project_with_jacobian(intrinsics, *ray - kStep * tangent.col(k));
    if (!after.valid || !before.valid) return Eigen::Vector2d::Zero();
    by_direction[static_cast<std::size_t>(k)] = (after.by_point - before.by_point) * tangent / (2 * kStep);
  }
  std::array<Eigen::Matrix2d, 2> s;
  for (int i = 0; i < 2; ++i) {
    Eigen::Matrix2d b;
    b << by_direction[0].row(i), by_direction[1].row(i);
    s[static_cast<std::size_t>(i)] = 0.5 * to_plane.transpose() * b * to_plane;
  }
  const Eigen::Vector2d traces(s[0].trace(), s[1].trace());
  const Eigen::Vector2d contractions = (s[0].row(0) + s[1].row(1)).transpose();
  return kernel_variance(diameter_px) / 3 * (traces + 2 * contractions);
}

FixedPixel without_eccentricity(const Intrinsics& intrinsics, const Keypoint& keypoint) {
  const Eigen::Vector2d pixel(from_fixed_pixel(keypoint.x), from_fixed_pixel(keypoint.y));
  const Eigen::Vector2d corrected = pixel - eccentricity_px(intrinsics, pixel, keypoint.scale_px);
  return {to_fixed_pixel(corrected.x()), to_fixed_pixel(corrected.y())};
}

}  // namespace megablock
