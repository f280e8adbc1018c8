// Joint adjustment of linked models by the places, points and images, that they share (M52).
//
// With S_m (model -> common frame), x_mi point i in model m, X_i its place and A_j, Q_mj attitudes of image j,
//
//     sum |S_m^-1 X_i - x_mi|^2 / sigma_mi^2  +  sum |Log(Q_mj' A_j R_m)|^2 / rho_mj^2
//
// in units of each model, so that no scale shrinks. X and A are eliminated: with errors alike on all axes their normal
// matrices are multiples of the unit matrix, and X_i is the mean of S_m x_mi with weights 1/(s_m sigma_mi)^2. What is
// left, seven unknowns a model, is solved by sparse Cholesky factorisation. Points and images are tested in every round
// of the first half, both ways, and the worst of a place is left out first. What is then no longer held together is
// taken apart, and the rest goes on without it.
#pragma once

#include "adjust/models/linked_models.h"

namespace megablock {

struct PlaceAdjustmentOptions {
  double rejection_probability = 1e-5;  // of a good point or image, by chance
  int max_iterations = 30;              // at least 1
  bool covariances = true;
};

struct PlaceAdjustment {
  std::vector<SimilarityCovariance> covariance;  // [models] of xi (model_link.h) about their centres, where asked for
  std::vector<std::int64_t> lost;  // numbers of the models that were taken out of the largest piece of their part
  double weighted_squares = 0;
  std::int64_t redundancy = 0;
  int iterations = 0;
  bool converged = true;  // false: ended by max_iterations
};

// Moves the similarities; what is left out is marked at the entries of the places, and at the links of what was taken
// apart. Throws ComputeError when it diverges.
PlaceAdjustment adjust_places(LinkedModels& linked, const PlaceAdjustmentOptions& options);

}  // namespace megablock
