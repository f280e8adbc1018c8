// Joins independent models (pairs of images or tiles, each in a frame of its own) to one block by one similarity
// each: the block adjustment of independent models (Kalantari 2009, chapter 9).
//
// The links between models give a start, first chained along the most trusted ones and then averaged (linked_models.h).
// All shared points and images are then adjusted together (place_adjustment.h).
//
// The frame of each connected part is that of its model with the lowest number, whose similarity is the identity.
// Models, points and images are taken in the order of their numbers, so that the result has the same bits in any order
// of input.
// Internal to adjust/: it is not installed.
#pragma once

#include "adjust/independent_models/model_link.h"

namespace megablock {

struct AssemblyOptions {
  LinkOptions links;
  bool joint = true;  // false: only a chain along the most trusted links, for comparison
  // Computing covariances takes about the time of two iterations, because the factor gives the needed entries of the
  // inverse.
  bool covariances = true;
  int max_iterations = 30;  // of the joint adjustment
  void check() const;       // throws InputError
};

struct AssembledModels {
  std::vector<Similarity> similarity;            // [models] model -> frame of its part
  std::vector<SimilarityCovariance> covariance;  // [models] of steps as in similarity.h, for the given sigmas
  std::vector<std::int64_t> part;                // [models] number of the model whose frame is the part's
  std::vector<std::int64_t> lost;  // numbers of models that links connect to others but shared places do not
  std::vector<ModelLink> links;    // a, b: rows of the given models; similarity b -> a as fitted to these two alone
  std::int64_t shared = 0, rejected = 0;  // entries of points and images that models share, in all models
  std::int64_t redundancy = 0;
  double sigma0 = 0;      // sqrt(weighted squares / redundancy)
  int iterations = 0;     // of the joint adjustment
  bool converged = true;  // false: ended by max_iterations
};

// Throws InputError for numbers that are not finite, sigmas that are not positive and numbers given twice, and
// ComputeError when the adjustment diverges. A model without links is a part of its own.
AssembledModels assemble_models(const std::vector<Model>& models, const AssemblyOptions& options = {});

}  // namespace megablock
