#include "geometry/rotation_fit.h"

#include <Eigen/SVD>
#include <cmath>
#include <vector>

#include "geometry/median.h"

namespace megablock {

Eigen::Quaterniond fit_rotation(std::span<const Eigen::Vector3d> from, std::span<const Eigen::Vector3d> to,
                                std::span<const double> weights) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < from.size(); ++i) sum += (weights.empty() ? 1 : weights[i]) * to[i] * from[i].transpose();
  if (!sum.allFinite()) return Eigen::Quaterniond(Eigen::Vector4d::Constant(std::nan("")));
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d middle = Eigen::Matrix3d::Identity();
  middle(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
  return Eigen::Quaterniond(Eigen::Matrix3d(svd.matrixU() * middle * svd.matrixV().transpose())).normalized();
}

Eigen::Quaterniond fit_rotation_robust(std::span<const Eigen::Vector3d> from, std::span<const Eigen::Vector3d> to) {
  constexpr int kRounds = 8;
  Eigen::Quaterniond rotation = fit_rotation(from, to);
  std::vector<double> residual(from.size()), weight(from.size());
  for (int round = 0; round < kRounds; ++round) {
    for (std::size_t i = 0; i < from.size(); ++i) residual[i] = (to[i] - rotation * from[i]).norm();
    const double scale = 3 * median(residual);
    if (!(scale > 1e-12)) break;
    for (std::size_t i = 0; i < from.size(); ++i)
      weight[i] = std::pow(1 + residual[i] * residual[i] / (scale * scale), -2);
    rotation = fit_rotation(from, to, weight);
  }
  return rotation;
}

}  // namespace megablock
