// Similarity between two sets of points that both carry errors, with its covariance (Kalantari 2009, M31, M50).
//
// y = s R x + t for the corrected x and y; three equations and six measurements a point (gauss_helmert.h). Steps are
// those of similarity.h. The adjustment refers to the centre of the x, so that places far
// from the origin cost no digits; the covariance is that of (w, q, d) about the origin all the same.
#pragma once

#include <span>

#include "geometry/estimation/gauss_helmert.h"
#include "geometry/similarity/similarity.h"

namespace megablock {

struct PointPair {
  Eigen::Vector3d from, to;
  Eigen::Matrix3d from_covariance, to_covariance;
};

struct AdjustedSimilarity {
  Similarity similarity;
  SimilarityCovariance covariance;
  double weighted_squares = 0;
  std::int64_t redundancy = 0;
};

// From `start`, which may be that of fit_similarity. Empty for fewer than three points, points on one line, numbers
// that are not finite, no error on either side, and a start too far off.
std::optional<AdjustedSimilarity> adjust_similarity(const Similarity& start, std::span<const PointPair> pairs);

}  // namespace megablock
