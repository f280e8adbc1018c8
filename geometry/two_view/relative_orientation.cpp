#include "geometry/two_view/relative_orientation.h"

#include <cmath>

#include "geometry/numbers/decompositions.h"

namespace megablock {

Solutions<RelativeOrientation, 4> orientations_of_essential(const Eigen::Matrix3d& essential) {
  Solutions<RelativeOrientation, 4> found;
  // Scaled to |t| = 1: the squared norm of an essential matrix is 2 |t|^2. The columns of its cofactor matrix are
  // multiples of t.
  const double scale = std::sqrt(0.5 * essential.squaredNorm());
  const Eigen::Matrix3d e = essential / scale;
  const Eigen::Matrix3d cofactor = cofactors(e);
  int longest = 0;
  for (int i = 1; i < 3; ++i)
    if (cofactor.col(i).squaredNorm() > cofactor.col(longest).squaredNorm()) longest = i;
  const double length = cofactor.col(longest).norm();
  if (!(length > 1e-6)) return found;
  const Eigen::Vector3d base = cofactor.col(longest) / length;
  const Eigen::Matrix3d turned = skew<double>(base) * e;
  for (const Eigen::Matrix3d& rotation : {Eigen::Matrix3d(cofactor - turned), Eigen::Matrix3d(cofactor + turned)}) {
    const Eigen::Quaterniond q = Eigen::Quaterniond(rotation).normalized();
    if (!q.coeffs().allFinite()) continue;
    found.push_back({q, base});
    found.push_back({q, -base});
  }
  return found;
}

Eigen::Matrix3d nearest_essential(const Eigen::Matrix3d& m) {
  const SingularValues3 svd = singular_values3(m);
  return svd.u * Eigen::Vector3d(std::sqrt(0.5), std::sqrt(0.5), 0).asDiagonal() * svd.v.transpose();
}

double mean_depth(const RelativeOrientation& o, std::span<const Eigen::Vector3d> a,
                  std::span<const Eigen::Vector3d> b) {
  const Eigen::Matrix3d rotation = o.rotation.toRotationMatrix();
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const ScaledDepths depths = scaled_depths(rotation, o.base, a[i], b[i]);
    sum += depths.a / depths.sine_squared * a[i].norm();
  }
  return sum / static_cast<double>(a.size());
}

// Support of a candidate: the sum of 1 - (r / threshold)^2 over inliers in front of both images, or with parallel rays.
namespace {

struct SupportOfOrientation {
  double support = 0, depth = 0;  // depth: mean over the inliers
  int inliers = 0;
};

SupportOfOrientation support_among(const RelativeOrientation& o, std::span<const Eigen::Vector3d> a,
                                   std::span<const Eigen::Vector3d> b, double threshold) {
  const Eigen::Matrix3d rotation = o.rotation.toRotationMatrix(), essential = skew<double>(o.base) * rotation;
  SupportOfOrientation s;
  const double limit = threshold * threshold;
  int measured = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double r = coplanarity_residual(essential, a[i], b[i]);
    if (!(r * r < limit)) continue;
    const ScaledDepths depths = scaled_depths(rotation, o.base, a[i], b[i]);
    const bool parallel = depths.sine_squared < limit;
    if (!parallel && !(depths.a > 0 && depths.b > 0)) continue;
    ++s.inliers;
    s.support += 1 - r * r / limit;
    if (parallel) continue;
    s.depth += depths.a / depths.sine_squared;
    ++measured;
  }
  s.depth /= std::max(measured, 1);
  return s;
}

}  // namespace

std::optional<ChosenOrientation> choose_orientation(std::span<const RelativeOrientation> candidates,
                                                    std::span<const Eigen::Vector3d> a,
                                                    std::span<const Eigen::Vector3d> b, const OrientationChoice& by) {
  const RelativeOrientation *best = nullptr, *second = nullptr;
  SupportOfOrientation of_best, of_second;
  // Equal support (to one per cent) leaves the choice to the depths; otherwise more support wins.
  const auto better = [&](const SupportOfOrientation& p, const SupportOfOrientation& q) {
    const bool same = std::abs(p.support - q.support) <= 0.01 * std::max(p.support, q.support);
    const bool p_far = p.depth >= by.min_mean_depth, q_far = q.depth >= by.min_mean_depth;
    return same && p_far != q_far ? p_far : p.support > q.support;
  };
  for (const RelativeOrientation& candidate : candidates) {
    const SupportOfOrientation support = support_among(candidate, a, b, by.threshold);
    if (support.inliers == 0) continue;
    if (!best || better(support, of_best)) {
      second = best;
      of_second = of_best;
      best = &candidate;
      of_best = support;
    } else if (!second || better(support, of_second)) {
      second = &candidate;
      of_second = support;
    }
  }
  if (!best) return std::nullopt;
  ChosenOrientation chosen{*best, of_best.support, of_best.inliers, std::nullopt};
  if (second && of_second.support > 0.95 * of_best.support) chosen.twin = *second;
  return chosen;
}

}  // namespace megablock
