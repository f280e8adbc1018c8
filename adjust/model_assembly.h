// Block adjustment of independent models: pairs, sub-blocks or tiles, each in a frame of its own, joined by one
// similarity each (M51, M52).
//
//  1. Links: a robust similarity between every two models that share points or images (model_link.h).
//  2. Trust: agreeing points times the share of the link's triangles that close within their covariances; a spanning
//     tree of the most trusted links gives the start. This is chaining, and its errors add up.
//  3. All links together, in least squares with their covariances and with weights that forget what contradicts
//     (Geman-McClure, its width following the median misfit); links that then contradict are removed.
//  4. All shared points and images together. With S_m (model -> common frame), x_mi point i in model m, X_i its place
//     and A_j, Q_mj attitudes of image j,
//
//         sum |S_m^-1 X_i - x_mi|^2 / sigma_mi^2  +  sum |Log(Q_mj' A_j R_m)|^2 / rho_mj^2
//
//     in units of each model, so that no scale shrinks. X and A are eliminated: with errors alike on all axes their
//     normal matrices are multiples of the unit matrix, and X_i is the mean of S_m x_mi with weights 1/(s_m
//     sigma_mi)^2. What is left, seven unknowns a model, is solved by sparse Cholesky factorisation. Points and images
//     are tested in every round, both ways, and the worst of a place is left out first. What is then no longer held
//     together is taken apart, and the rest goes on without it.
//
// The frame is that of the model with the lowest number in each part that hangs together; its similarity is the
// identity. Models, points and images are taken in the order of their numbers: the result has the same bits in whatever
// order they come.
#pragma once

#include "adjust/model_link.h"

namespace megablock {

struct AssemblyOptions {
  LinkOptions links;
  bool joint = true;        // false: only chained along the spanning tree (steps 1 and 2), for comparison
  bool covariances = true;  // by the entries of the inverse that the factor has: about the time of two iterations
  int max_iterations = 30;  // of the joint adjustment
  void check() const;       // throws InputError
};

struct AssembledModels {
  std::vector<Similarity> similarity;            // [models] model -> frame of its part
  std::vector<SimilarityCovariance> covariance;  // [models] of steps as in similarity.h, for sigmas as they were given
  std::vector<std::int64_t> part;                // [models] number of the model whose frame is the part's
  std::vector<std::int64_t> lost;                // numbers of models that links join to others, and places do not
  std::vector<ModelLink> links;                  // a, b: rows of the models given; similarity b -> a as adjusted alone
  std::int64_t shared = 0, rejected = 0;         // points and images in models, of those that models share
  std::int64_t redundancy = 0;
  double sigma0 = 0;      // sqrt(weighted squares / redundancy)
  int iterations = 0;     // of the joint adjustment
  bool converged = true;  // false: ended by max_iterations
};

// Throws InputError for numbers that are not finite, sigmas that are not positive, numbers given twice; ComputeError
// when the adjustment diverges. Models that nothing links are parts of their own.
AssembledModels assemble_models(const std::vector<Model>& models, const AssemblyOptions& options = {});

}  // namespace megablock
