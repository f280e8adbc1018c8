// Gives the similarity between two models of one block by a robust fit to the points and images that they share
// (Kalantari 2009, chapter 9: similarity from three points).
//
// A model is a set of points and images in a frame of its own, free in place, attitude and scale. Steps of a similarity
// S (model -> common frame) are taken in the model's own frame and units, xi = (w, q, d):
//
//     S E(xi),   E(xi): x -> x + w x x + q x + d;    S^-1 X moves by -(w x z + q z + d),   z = S^-1 X
//
// Nothing then depends on the frames of the models. For a link b -> a the residuals are taken in b: of a point or
// projection centre S^-1 x_a - x_b, with variance sigma_b^2 + sigma_a^2 / s^2; of an image's attitude Log(R' Q_a' Q_b),
// with the sum of the variances.
//
// The start is the best of samples, by the sum of squares truncated at a threshold. A sample is three points or centres
// (minimal_similarity.h), or one image's attitude with the distance of two of them. Least squares over the inliers
// improve it until the inliers no longer change. The draws depend on the numbers of the two models alone.
// Internal to adjust/: it is not installed.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "geometry/similarity/similarity.h"

namespace megablock {

struct ModelPoint {
  std::int64_t number = 0;  // of the point in the block
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  double sigma = 0;  // of a coordinate, units of the model
};
struct ModelImage {
  std::int64_t number = 0;    // of the image, or frame, in the block
  Pose pose;                  // model's frame -> image
  double centre_sigma = 0;    // of a coordinate, units of the model
  double rotation_sigma = 0;  // rad, of each axis
};
struct Model {
  std::int64_t number = 0;
  std::vector<ModelPoint> points;  // in any order, each number once; only those that models share matter
  std::vector<ModelImage> images;
};

// The points and images that two models share, by their rows in both.
struct SharedRows {
  std::vector<std::pair<std::int32_t, std::int32_t>> points, images;
};

struct ModelLink {
  std::int32_t a = -1, b = -1;                                      // rows of the models
  Similarity similarity;                                            // b -> a
  SimilarityCovariance information = SimilarityCovariance::Zero();  // inverse covariance of xi, in b
  int shared = 0, agreeing = 0;                                     // points and images
  bool kept = true;                                                 // false: it contradicts the other links
};

struct LinkOptions {
  double rejection_probability = 1e-5;  // probability that a good point or image is rejected by chance
  int min_redundancy = 8;   // equations of the inliers (3 for a point, 6 for an image) less 7; three places at least
  double min_share = 0.25;  // inliers / shared points and images
  int max_samples = 500;
  // Set this when only the order of magnitude of the models' errors is known. The sigmas of positions and of attitudes
  // are then each scaled by a factor of at least 1 that each link takes from the median misfit of its inliers. The
  // inliers are found a contrario (geometry/estimation/ransac.h) or, if these are too few, by the samples of which most
  // places agree.
  bool scale_sigmas = false;
  void check() const;  // throws InputError
};

// Fits the link b -> a. Empty where the inliers are too few or do not determine the similarity. `shared` is ascending,
// so that the result does not depend on the order of the points and images in the models.
std::optional<ModelLink> fit_model_link(const std::vector<Model>& models, std::int32_t a, std::int32_t b,
                                        const SharedRows& shared, const LinkOptions& options);

// Returns S E(xi).
Similarity move_in_model(const Similarity& similarity, const SimilarityStep& xi);

// Returns the xi with S = E(xi), for S near the identity.
SimilarityStep step_of(const Similarity& near_identity);

// Returns d(S^-1 X)/dxi at z = S^-1 X.
Eigen::Matrix<double, 3, 7> by_model_step(const Eigen::Vector3d& z);

}  // namespace megablock
