// Gives the estimator that ransac.h uses for a similarity between two sets of points with many wrong pairs.
//
//     SimilarityEstimator      3 points (minimal_similarity.h); residual: |y - S x| in standard deviations
//
// The variance of each coordinate of a residual is sigma_y^2 + s^2 sigma_x^2. A wrong pair is taken to have its y
// anywhere in the bounding box of all y.
#pragma once

#include <array>
#include <optional>
#include <span>

#include "geometry/numbers/solutions.h"
#include "geometry/similarity/similarity.h"

namespace megablock {

// A pair of corresponding points.
struct SimilarityPair {
  Eigen::Vector3d from, to;
  double sigma_from = 0, sigma_to = 0;  // standard deviation of a coordinate, in the units of each set; not both zero
};

class SimilarityEstimator {
 public:
  using Model = Similarity;
  static constexpr std::size_t kSampleSize = 3;
  // `pairs` must outlive the estimator. Pairs that are not finite never count as inliers.
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
  // Least squares over the pairs within the threshold. Empty for fewer than three.
  std::optional<Similarity> refine(const Similarity& s, double threshold) const;
  // Probability that a wrong pair has all three residuals within so many standard deviations.
  double chance(double sigmas) const;
  // Largest side of the bounding box of the y, in standard deviations.
  double extent() const { return sides_.maxCoeff(); }

 private:
  std::span<const SimilarityPair> pairs_;
  Eigen::Vector3d sides_ = Eigen::Vector3d::Zero();  // sides of the box, in median standard deviations
};

}  // namespace megablock
