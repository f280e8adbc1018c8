// Gives the common code of the models that correct the measured pixel m, from the distorted to the undistorted position
// (Cannelle 2013, section 2.2):
//
//     m + d(m) = (cx + f X/Z, cy + f Y/Z)                                                                      (1)
//
// The projection solves (1) by Newton's method, to rounding, starting from the pixel without distortion. It fails where
// the correction folds the image, that is where the determinant or the trace of the Jacobian is not positive. The
// derivatives follow from the implicit function theorem: with J = I + d'(m) and the right side P of (1), dm = J^-1
// (dP - d_p dp).
//
// A model derives from PixelCorrection<itself> and gives, besides names and parameters,
//   correction  d(m), a template for automatic differentiation in which parameters and pixel may have different types
//   correct     d(m) with its derivatives
#pragma once

#include <array>
#include <optional>

#include "geometry/camera/models/pinhole.h"

namespace megablock {

// d(m) with its derivatives by the pixel and by the parameters (zero for fixed ones, empty where not asked for).
struct Correction {
  Eigen::Vector2d value = Eigen::Vector2d::Zero();
  Eigen::Matrix2d by_pixel = Eigen::Matrix2d::Zero();
  IntrinsicJacobian by_parameters;
};

// Whether the corrected image is not folded at this pixel.
inline bool keeps_orientation(const Correction& c) {
  const Eigen::Matrix2d j = Eigen::Matrix2d::Identity() + c.by_pixel;
  return j(0, 0) * j(1, 1) - j(0, 1) * j(1, 0) > 0 && j.trace() > 0;
}

using Correct = Correction (*)(int order, const double* k, const Eigen::Vector2d& pixel, bool by_parameters);

// The pixel m with m + d(m) = `corrected`. NaN where the correction folds the image.
Eigen::Vector2d solve_correction(Correct correct, int order, const double* k, const Eigen::Vector2d& corrected);
// The projection with its derivatives; false where it has no pixel.
bool linearise_corrected(Correct correct, int order, const double* k, int count, const Eigen::Vector3d& point,
                         ProjectionJacobian& result);

template <typename Model>
struct PixelCorrection {
  static constexpr FieldOfView kField = FieldOfView::kFront;
  static constexpr bool kCorrectsPixels = true;
  static constexpr std::array<ColmapModel, 0> kColmap{};

  static bool sees(int, const double*, const Eigen::Vector3d& point) { return point.z() > 0; }
  template <typename Scalar>  // double only
  static PixelOf<Scalar> project(int order, const Scalar* k, const PointOf<Scalar>& point) {
    return solve_correction(&Model::correct, order, k, PinholeModel::project<double>(0, k, point));
  }
  static bool linearise(int order, const double* k, const Eigen::Vector3d& point, ProjectionJacobian& result) {
    return linearise_corrected(&Model::correct, order, k, Model::parameter_count(order), point, result);
  }
  static std::optional<Eigen::Vector2d> normalised(int order, const double* k, const Eigen::Vector2d& pixel) {
    const Correction c = Model::correct(order, k, pixel, false);
    if (!keeps_orientation(c)) return std::nullopt;
    return PinholeModel::normalised(0, k, pixel + c.value);
  }
};

}  // namespace megablock
