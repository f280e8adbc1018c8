// Projects a point into an image, and inverts and differentiates the projection, for every camera model. The formulas
// are in models/, one file a model. Each model decides which points it sees; FieldOfView in models/model.h gives the
// rule.
//
// Points are in camera axes (x right, y down, z along the view) in any unit. Pixels have their centres at +0.5.
#pragma once

#include <limits>
#include <optional>

#include "geometry/camera/intrinsics.h"

namespace megablock {

// The pixel of a point. NaN where the model has none.
Eigen::Vector2d project_other(const Intrinsics& k, const Eigen::Vector3d& point);  // all models but Brown
inline Eigen::Vector2d no_pixel() { return Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN()); }
inline Eigen::Vector2d project(const Intrinsics& k, const Eigen::Vector3d& point) {
  if (k.model().kind != CameraModelKind::kBrown) return project_other(k, point);
  return point.z() > 0 ? BrownModel::project<double>(0, k.data(), point) : no_pixel();
}

// Adjusted minus measured pixel. In a panorama both edges of the image are the same place, so its difference is taken
// modulo a full turn and is at most half of one.
template <typename Scalar>
Eigen::Matrix<Scalar, 2, 1> pixel_difference(const CameraModel& model, const Scalar* k,
                                             const Eigen::Matrix<Scalar, 2, 1>& adjusted,
                                             const Eigen::Vector2d& measured) {
  using std::floor;
  Eigen::Matrix<Scalar, 2, 1> difference(adjusted.x() - measured.x(), adjusted.y() - measured.y());
  if (is_panorama(model)) {
    const Scalar turn = (2 * 3.14159265358979323846) * k[kFocal];
    difference.x() -= turn * floor(difference.x() / turn + 0.5);
  }
  return difference;
}
inline Eigen::Vector2d pixel_difference(const Intrinsics& k, const Eigen::Vector2d& adjusted,
                                        const Eigen::Vector2d& measured) {
  return pixel_difference<double>(k.model(), k.data(), adjusted, measured);
}

// Projected minus measured pixel. NaN where the model has no pixel for the point.
inline Eigen::Vector2d reprojection(const Intrinsics& k, const Eigen::Vector3d& point,
                                    const Eigen::Vector2d& measured) {
  return pixel_difference(k, project(k, point), measured);
}

ProjectionJacobian project_with_jacobian(const Intrinsics& k, const Eigen::Vector3d& point);

// The unit viewing direction of a pixel in camera axes. Empty where the model cannot be inverted: beyond the radius
// where the radial polynomial turns back, where a correction folds the image, and above the poles of a panorama.
std::optional<Eigen::Vector3d> viewing_ray(const Intrinsics& k, const Eigen::Vector2d& pixel);

// The ray of viewing_ray() with its derivatives by the pixel m and by the parameters k (zero for fixed ones). By the
// implicit function theorem, with the tangent basis T of the ray and the projection p, dray = T (p_X T)^-1 (dm - p_k
// dk).
struct RayJacobian {
  bool valid = false;  // otherwise the rest is undefined
  Eigen::Vector3d ray;
  Eigen::Matrix<double, 3, 2> by_pixel;
  Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::ColMajor, 3, kMaxIntrinsics> by_intrinsics;
};
RayJacobian ray_with_jacobian(const Intrinsics& k, const Eigen::Vector2d& pixel);

// Two unit vectors (columns) that form an orthonormal basis with the unit vector `direction`.
Eigen::Matrix<double, 3, 2> tangent_plane(const Eigen::Vector3d& direction);

// For models that correct the measured pixel (corrects_pixels()): the correction d(m) with its derivative by the pixel,
// and the pixel m with m + d(m) = `corrected`, NaN where the model folds the image. See models/pixel_correction.h.
Correction correction_at(const Intrinsics& k, const Eigen::Vector2d& pixel);
Eigen::Vector2d solve_correction(const Intrinsics& k, const Eigen::Vector2d& corrected);

// The normalised image point (x, y) = (X/Z, Y/Z) of a pixel. Empty where viewing_ray() is, and for rays with Z <= 0.
std::optional<Eigen::Vector2d> unproject(const Intrinsics& k, const Eigen::Vector2d& pixel);

}  // namespace megablock
