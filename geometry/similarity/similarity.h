// Gives the similarity transformation y = s R x + t (scale s, rotation R, translation t) between two sets of points,
// its least-squares fit with covariance, and a robust fit. All have one solution.
//
// Least squares are in closed form, with weights (S. Umeyama, "Least-squares estimation of transformation parameters
// between two point patterns", IEEE PAMI 13(4), 1991). With centred points and the decomposition sum w y x' = U D V',
// R = U S V' with S = diag(1, 1, det(U V')), s = trace(D S) / sum w |x|^2.
//
// The robust fit minimises Cauchy's loss, sum log(1 + (|r_i| / sigma_i)^2). It takes the better of the least-squares
// solution and of the best samples of three points (ransac.h), and refines it by iterated reweighting.
//
// The tangent increment of a similarity is (w, q, d): R Exp(w) (rotation.h), s exp(q), t + d. Written about the
// centroid c, y = s R (x - c) + u, the normal matrix of the least squares is block diagonal:
//
//     w: s^2 sum g (|x - c|^2 I - (x - c)(x - c)')     q: s^2 sum g |x - c|^2     u: sum g I
//
// with g the inverse variances. The translation is t = u - s R c.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <span>

#include "geometry/transform/pose.h"

namespace megablock {

// y = scale * rotation * x + translation.
struct Similarity {
  double scale = 1;
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator()(const Eigen::Vector3d& x) const { return scale * (rotation * x) + translation; }
  // Pose of a frame once its ground coordinates are transformed.
  Pose operator()(const Pose& pose) const {
    return {(pose.rotation * rotation.conjugate()).normalized(), (*this)(pose.centre)};
  }
  Similarity inverse() const;
  Similarity operator*(const Similarity& first) const;  // the similarity that applies `first`, then this one
};

// Weighted least squares from -> to. The weights are of squared distances; empty means equal weights. Two points, or
// points on one line, leave the rotation about the line arbitrary, but the result is a rotation. Empty for fewer than
// two points, for points without extent, for input that is not finite, and for lists of different length.
std::optional<Similarity> fit_similarity(std::span<const Eigen::Vector3d> from, std::span<const Eigen::Vector3d> to,
                                         std::span<const double> weights = {});

using SimilarityStep = Eigen::Matrix<double, 7, 1>;        // (w, q, d): radians, none, units of `to`
using SimilarityCovariance = Eigen::Matrix<double, 7, 7>;  // covariance of such an increment

// The similarity moved by an increment.
Similarity similarity_update(const Similarity& similarity, const SimilarityStep& step);

// Covariance of a result of fit_similarity for the same `from` and weights. The weights must be inverse variances of
// the coordinates of y - s R x; where x has errors too, these variances include s^2 times those of x. Weights known
// only up to a factor give the covariance up to the inverse of that factor. Empty for fewer than three points and for
// points on one line.
std::optional<SimilarityCovariance> similarity_covariance(const Similarity& fitted,
                                                          std::span<const Eigen::Vector3d> from,
                                                          std::span<const double> weights = {});

// Turns a covariance of (w, q, u) about the centroid c of `from` into that of (w, q, d) about the origin.
SimilarityCovariance covariance_about_origin(const Similarity& similarity, const Eigen::Vector3d& centre,
                                             const SimilarityCovariance& about_centre);

// Robust fit. `sigma` is the standard deviation of a coordinate in the units of `to`, one per point. The samples depend
// on `seed` alone, so the result is deterministic. Empty where fit_similarity is.
std::optional<Similarity> fit_similarity_robust(std::span<const Eigen::Vector3d> from,
                                                std::span<const Eigen::Vector3d> to, std::span<const double> sigma,
                                                int max_draws = 300, std::uint64_t seed = 1);

}  // namespace megablock
