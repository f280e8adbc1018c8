#include "geometry/camera/models/brown.h"

#include <Eigen/LU>

namespace megablock {

std::vector<CameraParameter> BrownModel::parameters(int) {
  std::vector<CameraParameter> all = common_parameters();
  add_radial_terms(3, all);
  all.push_back({"p1", ParameterRole::kTangential});
  all.push_back({"p2", ParameterRole::kTangential});
  for (const char* name : {"b1", "b2"})
    all.push_back({.name = name, .role = ParameterRole::kAffinity, .unit = ParameterUnit::kPixels, .rare = true});
  return all;
}

std::optional<Eigen::Vector2d> BrownModel::normalised(int, const double* k, const Eigen::Vector2d& pixel) {
  // (x', y'), which have the affinity no longer.
  Eigen::Vector2d target(pixel.x() - k[kPrincipalX], (pixel.y() - k[kPrincipalY]) / k[kFocal]);
  target.x() = (target.x() - k[kSkew] * target.y()) / (k[kFocal] + k[kAffinity]);
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
