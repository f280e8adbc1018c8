#include "geometry/similarity/similarity.h"

#include <array>
#include <cmath>
#include <vector>

#include "geometry/estimation/gauss_helmert.h"
#include "geometry/estimation/ransac.h"
#include "geometry/numbers/decompositions.h"
#include "geometry/similarity/similarity_estimator.h"
#include "geometry/transform/rotation.h"

namespace megablock {

Similarity Similarity::inverse() const {
  const Eigen::Quaterniond back = rotation.conjugate();
  return {1 / scale, back, -(back * translation) / scale};
}

Similarity Similarity::operator*(const Similarity& first) const {
  return {scale * first.scale, rotation * first.rotation, (*this)(first.translation)};
}

std::optional<Similarity> fit_similarity(std::span<const Eigen::Vector3d> from, std::span<const Eigen::Vector3d> to,
                                         std::span<const double> weights) {
  const std::size_t count = from.size();
  if (count < 2 || to.size() != count || (!weights.empty() && weights.size() != count)) return std::nullopt;
  const auto weight = [&](std::size_t i) { return weights.empty() ? 1.0 : weights[i]; };

  double total = 0;
  Eigen::Vector3d mean_from = Eigen::Vector3d::Zero(), mean_to = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < count; ++i) {
    total += weight(i);
    mean_from += weight(i) * from[i];
    mean_to += weight(i) * to[i];
  }
  if (!(total > 0)) return std::nullopt;
  mean_from /= total;
  mean_to /= total;

  double spread = 0;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector3d x = from[i] - mean_from, y = to[i] - mean_to;
    spread += weight(i) * x.squaredNorm();
    covariance += weight(i) * y * x.transpose();
  }
  if (!covariance.allFinite()) return std::nullopt;
  const SingularValues3 svd = singular_values3(covariance);
  if (!(spread > 0) || !(svd.values(0) > 0)) return std::nullopt;
  Eigen::Vector3d sign(1, 1, 1);  // if a reflection fits better, the axis with the smallest singular value is reversed
  if (svd.u.determinant() * svd.v.determinant() < 0) sign.z() = -1;

  Similarity result;
  const Eigen::Matrix3d rotation = svd.u * sign.asDiagonal() * svd.v.transpose();
  result.rotation = Eigen::Quaterniond(rotation).normalized();
  result.scale = svd.values.dot(sign) / spread;
  result.translation = mean_to - result.scale * (result.rotation * mean_from);
  if (!(result.scale > 0) || !result.translation.allFinite()) return std::nullopt;
  return result;
}

Similarity similarity_update(const Similarity& similarity, const SimilarityStep& step) {
  return {similarity.scale * std::exp(step(3)), rotation_update(similarity.rotation, step.head<3>()),
          similarity.translation + step.tail<3>()};
}

std::optional<SimilarityCovariance> similarity_covariance(const Similarity& fitted,
                                                          std::span<const Eigen::Vector3d> from,
                                                          std::span<const double> weights) {
  if (from.size() < 3 || (!weights.empty() && weights.size() != from.size())) return std::nullopt;
  const auto weight = [&](std::size_t i) { return weights.empty() ? 1.0 : weights[i]; };
  double total = 0;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < from.size(); ++i) {
    total += weight(i);
    centre += weight(i) * from[i];
  }
  if (!(total > 0)) return std::nullopt;
  centre /= total;
  Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < from.size(); ++i)
    moments += weight(i) * (from[i] - centre) * (from[i] - centre).transpose();
  const double squares = fitted.scale * fitted.scale;
  const Eigen::Matrix3d turns = squares * (moments.trace() * Eigen::Matrix3d::Identity() - moments);
  const SymmetricEigen3 eigen = symmetric_eigen3(turns);
  constexpr double kLine = 1e-12;  // smallest over largest moment of inertia; zero for points on one line
  if (!(eigen.values(0) > kLine * eigen.values(2)) || !turns.allFinite()) return std::nullopt;
  // About the centre the three groups of unknowns are uncorrelated (see the head of similarity.h).
  SimilarityCovariance about_centre = SimilarityCovariance::Zero();
  about_centre.topLeftCorner<3, 3>() =
      eigen.vectors * eigen.values.cwiseInverse().asDiagonal() * eigen.vectors.transpose();
  about_centre(3, 3) = 1 / (squares * moments.trace());
  about_centre.bottomRightCorner<3, 3>() = Eigen::Matrix3d::Identity() / total;
  return covariance_about_origin(fitted, centre, about_centre);
}

SimilarityCovariance covariance_about_origin(const Similarity& similarity, const Eigen::Vector3d& centre,
                                             const SimilarityCovariance& about_centre) {
  // t = u - s R c gives dt = du + s R [c]x w - s R c q.
  const Eigen::Matrix3d turn = similarity.scale * similarity.rotation.toRotationMatrix();
  SimilarityCovariance about_origin = SimilarityCovariance::Identity();
  about_origin.bottomLeftCorner<3, 3>() = turn * skew(centre);
  about_origin.block<3, 1>(4, 3) = -turn * centre;
  return propagated(about_origin, about_centre);
}

namespace {

// Unlike its base, this estimator also takes samples on one line. They leave the rotation about the line arbitrary.
class PlacesEstimator : public SimilarityEstimator {
 public:
  explicit PlacesEstimator(std::span<const SimilarityPair> pairs) : SimilarityEstimator(pairs), pairs_(pairs) {}
  Solutions<Similarity, 1> solve(const std::array<std::size_t, 3>& rows) const {
    std::array<Eigen::Vector3d, 3> from, to;
    for (std::size_t k = 0; k < 3; ++k) from[k] = pairs_[rows[k]].from, to[k] = pairs_[rows[k]].to;
    Solutions<Similarity, 1> found;
    if (const auto s = fit_similarity(from, to)) found.push_back(*s);
    return found;
  }

 private:
  std::span<const SimilarityPair> pairs_;
};

// The robust cost: sum of log(1 + (|r| / sigma)^2).
double cauchy_cost(const Similarity& s, std::span<const Eigen::Vector3d> from, std::span<const Eigen::Vector3d> to,
                   std::span<const double> sigma) {
  double cost = 0;
  for (std::size_t i = 0; i < from.size(); ++i)
    cost += std::log1p((s(from[i]) - to[i]).squaredNorm() / (sigma[i] * sigma[i]));
  return cost;
}

}  // namespace

std::optional<Similarity> fit_similarity_robust(std::span<const Eigen::Vector3d> from,
                                                std::span<const Eigen::Vector3d> to, std::span<const double> sigma,
                                                int max_draws, std::uint64_t seed) {
  const std::size_t count = from.size();
  if (to.size() != count || sigma.size() != count) return std::nullopt;
  std::vector<double> weights(count);
  for (std::size_t i = 0; i < count; ++i) weights[i] = 1 / (sigma[i] * sigma[i]);
  auto best = fit_similarity(from, to, weights);
  if (!best) return std::nullopt;
  double best_cost = cauchy_cost(*best, from, to, sigma);
  const auto consider = [&](const std::optional<Similarity>& candidate) {
    if (!candidate) return false;
    const double cost = cauchy_cost(*candidate, from, to, sigma);
    if (!(cost < best_cost)) return false;
    best = candidate;
    best_cost = cost;
    return true;
  };

  std::vector<SimilarityPair> pairs;
  for (std::size_t i = 0; i < count; ++i) pairs.push_back({from[i], to[i], 0, sigma[i]});
  // Where the sigmas are too small, few points agree with any sample, and chance decides which of the best samples is
  // first. So the ten best enter the robust cost.
  constexpr std::size_t kKeep = 10;
  const RansacOptions options{
      .threshold = threshold_of_sigma(1, 3), .max_draws = max_draws, .keep = kKeep, .seed = seed};
  if (const auto found = ransac(PlacesEstimator(pairs), options); found && count > 3) {
    consider(found->model);
    for (const Similarity& other : found->others) consider(other);
  }
  // Iterated reweighting. The derivative of Cauchy's loss gives the weight 1 / (sigma^2 + r^2).
  constexpr int kIterations = 100;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    for (std::size_t i = 0; i < count; ++i)
      weights[i] = 1 / (sigma[i] * sigma[i] + ((*best)(from[i]) - to[i]).squaredNorm());
    const double before = best_cost;
    if (!consider(fit_similarity(from, to, weights)) || before - best_cost < 1e-12 * before) break;
  }
  return best;
}

}  // namespace megablock
