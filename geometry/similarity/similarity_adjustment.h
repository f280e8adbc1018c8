// Adjusts a similarity between two sets of points that both carry errors, with its covariance (Kalantari 2009, chapter
// 9).
//
// The equation s R x + t - y = 0 holds for the corrected x and y: three equations and six observations a point, in the
// Gauss-Helmert model (gauss_helmert.h). Increments are those of similarity.h. The adjustment refers to the centroids,
// so that points far from the origin cost no digits; the covariance is that of (w, q, d) about the origin all the same.
#pragma once

#include <span>

#include "geometry/estimation/gauss_helmert.h"
#include "geometry/similarity/similarity.h"

namespace megablock {

// A point in both systems, with the covariance matrices of its coordinates.
struct PointPair {
  Eigen::Vector3d from, to;
  Eigen::Matrix3d from_covariance, to_covariance;
};

struct AdjustedSimilarity {
  Similarity similarity;
  SimilarityCovariance covariance;
  // Divided by the redundancy, this estimates the variance factor.
  double weighted_squares = 0;
  std::int64_t redundancy = 0;
};

// Adjusts from the approximation `start`, for example the result of fit_similarity. Empty for fewer than three points,
// for points on one line, for input that is not finite, for points without errors in both systems, and where the
// approximation is too far off for the iterations to converge.
std::optional<AdjustedSimilarity> adjust_similarity(const Similarity& start, std::span<const PointPair> pairs);

}  // namespace megablock
