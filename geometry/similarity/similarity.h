// Similarity transformation (scale, rotation, translation) between two sets of points: y = s R x + t.
//
// Least squares in closed form after Umeyama, "Least-squares estimation of transformation parameters between two point
// patterns", IEEE PAMI 13(4), 1991, with weights. The robust variant minimises sum log(1 + (|r_i| / sigma_i)^2)
// (Cauchy): the best of the least squares solution and of what samples of three points find (ransac.h), refined by
// iterated reweighting. Each has one solution.
//
// Steps of a similarity are (w, q, d): R Exp(w) (rotation.h), s exp(q), t + d. About the centroids, y = s R (x - c) +
// u, the normal equations of the closed form fall apart,
//
//     w: s^2 sum g (|x - c|^2 I - (x - c)(x - c)')     q: s^2 sum g |x - c|^2     u: sum g I
//
// with g the inverse variances; and t = u - s R c.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <span>

#include "geometry/transform/pose.h"

namespace megablock {

struct Similarity {
  double scale = 1;
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator()(const Eigen::Vector3d& x) const { return scale * (rotation * x) + translation; }
  // Pose of a frame after its ground coordinates are transformed.
  Pose operator()(const Pose& pose) const {
    return {(pose.rotation * rotation.conjugate()).normalized(), (*this)(pose.centre)};
  }
  Similarity inverse() const;
  Similarity operator*(const Similarity& first) const;  // `first`, then this one
};

// Weighted least squares from -> to; weights of squared distances, empty = all one. Two points or points on one line
// leave the rotation about the line arbitrary (but proper). Empty with fewer than two points, no extent, what is not a
// number, or not equally many of each.
std::optional<Similarity> fit_similarity(std::span<const Eigen::Vector3d> from, std::span<const Eigen::Vector3d> to,
                                         std::span<const double> weights = {});

using SimilarityStep = Eigen::Matrix<double, 7, 1>;        // (w, q, d): rad, -, units of `to`
using SimilarityCovariance = Eigen::Matrix<double, 7, 7>;  // of such a step

Similarity similarity_update(const Similarity& similarity, const SimilarityStep& step);

// Covariance of what fit_similarity returned for the same `from` and weights, where these are inverse variances: of the
// coordinates of y - s R x, which is s^2 times the variance of those of x where x has errors too. Weights known up to a
// factor leave the covariance known up to its inverse. Empty for points on one line and fewer than three.
std::optional<SimilarityCovariance> similarity_covariance(const Similarity& fitted,
                                                          std::span<const Eigen::Vector3d> from,
                                                          std::span<const double> weights = {});

// From a covariance of (w, q, u) about the centre c of `from` to that of (w, q, d).
SimilarityCovariance covariance_about_origin(const Similarity& similarity, const Eigen::Vector3d& centre,
                                             const SimilarityCovariance& about_centre);

// Robust fit; sigma of a coordinate in the units of `to`, one per point. Deterministic: the samples depend on `seed`
// alone. Empty where the least squares are.
std::optional<Similarity> fit_similarity_robust(std::span<const Eigen::Vector3d> from,
                                                std::span<const Eigen::Vector3d> to, std::span<const double> sigma,
                                                int max_draws = 300, std::uint64_t seed = 1);

}  // namespace megablock
