#include "geometry/camera/models/brown.h"

#include <Eigen/LU>

namespace megablock {

std::vector<CameraParameter> BrownModel::parameters(int) {
  std::vector<CameraParameter> all = common_parameters();
  add_radial_terms(3, all);
  all.push_back({"p1", ParameterRole::kTangential});
  all.push_back({"p2", ParameterRole::kTangential});
  return all;
}

std::optional<Eigen::Vector2d> BrownModel::normalised(int, const double* k, const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d target = in_focal_lengths(k, pixel);
  Eigen::Vector2d p = target;
  constexpr int kMaxIterations = 50;
  for (int i = 0; i < kMaxIterations; ++i) {
    const Distortion d = distort(k, p.x(), p.y());
    if (!(d.jacobian.determinant() > 0) || !(d.jacobian.trace() > 0)) return std::nullopt;
    const Eigen::Vector2d step = d.jacobian.inverse() * (target - d.point);
    p += step;
    if (!p.allFinite()) return std::nullopt;
    if (step.squaredNorm() < 1e-26 * (1 + p.squaredNorm())) return p;
  }
  return std::nullopt;
}

}  // namespace megablock
