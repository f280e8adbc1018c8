// Estimator of ransac.h for a similarity between two sets of points of which many may not belong together.
//
//     SimilarityEstimator      3 points (minimal_similarity.h); |y - S x| in sigmas
//
// sigma^2 = sigma_y^2 + s^2 sigma_x^2, of each coordinate. Wrong points are taken to lie anywhere in the box of the y.
#pragma once

#include <array>
#include <optional>
#include <span>

#include "geometry/numbers/solutions.h"
#include "geometry/similarity/similarity.h"

namespace megablock {

struct SimilarityPair {
  Eigen::Vector3d from, to;
  double sigma_from = 0, sigma_to = 0;  // of a coordinate, in the units of each; not both zero
};

class SimilarityEstimator {
 public:
  using Model = Similarity;
  static constexpr std::size_t kSampleSize = 3;
  // The pairs must outlive it. Those that are not numbers are no inliers.
  explicit SimilarityEstimator(std::span<const SimilarityPair> pairs);
  std::size_t size() const { return pairs_.size(); }
  Solutions<Similarity, 1> solve(const std::array<std::size_t, 3>& rows) const;
  auto squared_residuals(const Similarity& s) const {
    return [pairs = pairs_, turn = Eigen::Matrix3d(s.scale * s.rotation.toRotationMatrix()), shift = s.translation,
            square = s.scale * s.scale](std::size_t i) {
      const SimilarityPair& p = pairs[i];
      return (p.to - turn * p.from - shift).squaredNorm() /
             (p.sigma_to * p.sigma_to + square * p.sigma_from * p.sigma_from);
    };
  }
  // Least squares over the pairs within the threshold.
  std::optional<Similarity> refine(const Similarity& s, double threshold) const;
  // Probability that a wrong pair comes within so many sigmas of a coordinate.
  double chance(double sigmas) const;
  // Largest size of the box of the y, in sigmas.
  double extent() const { return sides_.maxCoeff(); }

 private:
  std::span<const SimilarityPair> pairs_;
  Eigen::Vector3d sides_ = Eigen::Vector3d::Zero();  // of the box, in median sigmas
};

}  // namespace megablock
