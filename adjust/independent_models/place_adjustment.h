// Adjusts the similarities of linked models together, by the points and images that they share (Kalantari 2009, chapter
// 9: block adjustment of independent models).
//
// With S_m (model -> common frame), x_mi the point or projection centre i in model m, X_i its position in the common
// frame, and A_j, Q_mj the attitudes of image j in the common frame and in model m, it minimises
//
//     sum |S_m^-1 X_i - x_mi|^2 / sigma_mi^2  +  sum |Log(Q_mj' A_j R_m)|^2 / rho_mj^2
//
// The residuals are in units of each model, because residuals in the common frame would shrink with the scales. X and A
// are eliminated. Their errors are equal on all axes, so their normal matrices are multiples of the unit matrix, and
// X_i is the mean of S_m x_mi with weights 1/(s_m sigma_mi)^2. The seven unknowns of each model remain and are solved
// by sparse Cholesky factorisation. Points and images are tested in the first half of the iterations, and may come
// back; the worst entry of a point or image is left out first. Models that are then no longer held together are taken
// apart.
// Internal to adjust/: it is not installed.
#pragma once

#include "adjust/independent_models/linked_models.h"

namespace megablock {

struct PlaceAdjustmentOptions {
  double rejection_probability = 1e-5;  // probability that a good point or image is rejected by chance
  int max_iterations = 30;              // at least 1
  bool covariances = true;
};

struct PlaceAdjustment {
  std::vector<SimilarityCovariance> covariance;  // [models] of xi (model_link.h) about their centres, if asked for
  std::vector<std::int64_t> lost;  // numbers of the models that were taken out of the largest piece of their part
  double weighted_squares = 0;
  std::int64_t redundancy = 0;
  int iterations = 0;
  bool converged = true;  // false: ended by max_iterations
};

// Moves the similarities of `linked`. It marks outliers at the entries of the places, and the broken links of models
// that were taken apart. Throws ComputeError when it diverges.
PlaceAdjustment adjust_places(LinkedModels& linked, const PlaceAdjustmentOptions& options);

}  // namespace megablock
