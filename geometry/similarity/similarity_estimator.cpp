#include "geometry/similarity/similarity_estimator.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "geometry/numbers/median.h"
#include "geometry/similarity/minimal_similarity.h"

namespace megablock {

SimilarityEstimator::SimilarityEstimator(std::span<const SimilarityPair> pairs) : pairs_(pairs) {
  Eigen::AlignedBox3d from, to;
  std::vector<double> sigma_from, sigma_to;
  for (const SimilarityPair& p : pairs) {
    if (!p.from.allFinite() || !p.to.allFinite()) continue;
    from.extend(p.from);
    to.extend(p.to);
    sigma_from.push_back(p.sigma_from);
    sigma_to.push_back(p.sigma_to);
  }
  if (to.isEmpty() || !(from.diagonal().norm() > 0)) return;
  // Approximate scale, good enough to weigh the two sigmas.
  const double scale = to.diagonal().norm() / from.diagonal().norm();
  sides_ = to.sizes() / std::hypot(median(std::move(sigma_to)), scale * median(std::move(sigma_from)));
}

Solutions<Similarity, 1> SimilarityEstimator::solve(const std::array<std::size_t, 3>& rows) const {
  const SimilarityPair &p = pairs_[rows[0]], &q = pairs_[rows[1]], &r = pairs_[rows[2]];
  Solutions<Similarity, 1> found;
  if (const auto s = solve_similarity({p.from, q.from, r.from}, {p.to, q.to, r.to})) found.push_back(*s);
  return found;
}

std::optional<Similarity> SimilarityEstimator::refine(const Similarity& s, double threshold) const {
  const auto squared_residual = squared_residuals(s);
  std::vector<Eigen::Vector3d> from, to;
  std::vector<double> weights;
  for (std::size_t i = 0; i < size(); ++i) {
    if (!(squared_residual(i) <= threshold * threshold)) continue;
    const SimilarityPair& p = pairs_[i];
    from.push_back(p.from);
    to.push_back(p.to);
    weights.push_back(1 / (p.sigma_to * p.sigma_to + s.scale * s.scale * p.sigma_from * p.sigma_from));
  }
  if (from.size() < kSampleSize) return std::nullopt;
  return fit_similarity(from, to, weights);
}

double SimilarityEstimator::chance(double sigmas) const {
  double share = 1;
  for (const double side : sides_) share *= std::min(1.0, 2 * sigmas / std::max(side, 1e-300));
  return share;
}

}  // namespace megablock
