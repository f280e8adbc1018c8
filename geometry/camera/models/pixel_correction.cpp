#include "geometry/camera/models/pixel_correction.h"

#include <Eigen/LU>
#include <limits>

namespace megablock {

Eigen::Vector2d solve_correction(Correct correct, int order, const double* k, const Eigen::Vector2d& corrected) {
  constexpr int kMaxIterations = 30;
  // After a step of this length the error is its square times the curvature (far below 1 per pixel), that is rounding.
  constexpr double kLastStepPx = 1e-7;
  Eigen::Vector2d m = corrected;
  for (int i = 0; i < kMaxIterations; ++i) {
    const Correction c = correct(order, k, m, false);
    if (!keeps_orientation(c)) break;
    const Eigen::Matrix2d jacobian = Eigen::Matrix2d::Identity() + c.by_pixel;
    const Eigen::Vector2d step = jacobian.inverse() * (corrected - m - c.value);
    m += step;
    if (!m.allFinite()) break;
    if (step.squaredNorm() < kLastStepPx * kLastStepPx) return m;
  }
  return Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
}

bool linearise_corrected(Correct correct, int order, const double* k, int count, const Eigen::Vector3d& point,
                         ProjectionJacobian& result) {
  if (!PinholeModel::linearise(k, count, point, result)) return false;
  result.pixel = solve_correction(correct, order, k, result.pixel);
  if (!result.pixel.allFinite()) return false;
  const Correction c = correct(order, k, result.pixel, true);
  const Eigen::Matrix2d inverse = (Eigen::Matrix2d::Identity() + c.by_pixel).inverse();
  result.by_point = (inverse * result.by_point).eval();
  result.by_intrinsics = (inverse * (result.by_intrinsics - c.by_parameters)).eval();
  return true;
}

}  // namespace megablock
