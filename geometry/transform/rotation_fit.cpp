#include "geometry/transform/rotation_fit.h"

#include <cmath>
#include <vector>

#include "geometry/numbers/decompositions.h"
#include "geometry/numbers/median.h"

namespace megablock {

Eigen::Quaterniond rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  const Eigen::Vector3d a = from.normalized(), b = to.normalized();
  const double cosine = b.dot(a);
  // Opposite: rounding decides the axis, so two quarter turns by way of a perpendicular vector.
  if (cosine < -1 + 1e-12) {
    const Eigen::Vector3d across = a.unitOrthogonal();
    return rotation_between(across, b) * rotation_between(a, across);
  }
  // The half-angle quaternion without trigonometric functions: cos(t/2) = sqrt((1 + cos t) / 2).
  const double length = std::sqrt((1 + cosine) * 2);
  Eigen::Quaterniond rotation;
  rotation.vec() = a.cross(b) * (1 / length);
  rotation.w() = length * 0.5;
  return rotation;
}

Eigen::Quaterniond fit_rotation(std::span<const Eigen::Vector3d> from, std::span<const Eigen::Vector3d> to,
                                std::span<const double> weights) {
  const Eigen::Quaterniond unknown(Eigen::Vector4d::Constant(std::nan("")));
  if (to.size() != from.size() || (!weights.empty() && weights.size() != from.size())) return unknown;
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < from.size(); ++i) sum += (weights.empty() ? 1 : weights[i]) * to[i] * from[i].transpose();
  if (!sum.allFinite()) return unknown;
  const SingularValues3 svd = singular_values3(sum);
  // U V' may be a reflection. The best rotation then gives up the axis with the smallest singular value.
  Eigen::Matrix3d middle = Eigen::Matrix3d::Identity();
  middle(2, 2) = (svd.u * svd.v.transpose()).determinant() < 0 ? -1 : 1;
  return Eigen::Quaterniond(Eigen::Matrix3d(svd.u * middle * svd.v.transpose())).normalized();
}

Eigen::Quaterniond fit_rotation_robust(std::span<const Eigen::Vector3d> from, std::span<const Eigen::Vector3d> to) {
  constexpr int kRounds = 8;
  Eigen::Quaterniond rotation = fit_rotation(from, to);
  if (!rotation.coeffs().allFinite()) return rotation;
  std::vector<double> residual(from.size()), weight(from.size());
  for (int round = 0; round < kRounds; ++round) {
    for (std::size_t i = 0; i < from.size(); ++i) residual[i] = (to[i] - rotation * from[i]).norm();
    // Exact directions leave nothing to weigh.
    const double scale = 3 * median(residual);
    if (!(scale > 1e-12)) break;
    for (std::size_t i = 0; i < from.size(); ++i)
      weight[i] = std::pow(1 + residual[i] * residual[i] / (scale * scale), -2);
    rotation = fit_rotation(from, to, weight);
  }
  return rotation;
}

}  // namespace megablock
