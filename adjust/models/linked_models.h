// Models by their numbers, what they share and the links between them; from the links alone, a start for their joint
// adjustment (M51).
//
// Links and trust: a robust similarity between every two models that share points or images (model_link.h), and its
// agreeing points times the share of the link's triangles that close within their covariances. The spanning tree of
// the most trusted links is the first start; this is chaining, and its errors add up. Averaging brings all links
// together, in least squares with their covariances P^-1: of a link b -> a, and steps xi of its models,
//
//     e = Log(S_ba^-1 S_a^-1 S_b),     e -> e + xi_b - T xi_a  (T: a's frame -> b's),     sum w(e) e' P e = min
//
// with weights w = (1 + e' P e / c)^-2 that forget what contradicts (Geman-McClure), their width c following the median
// misfit.
#pragma once

#include <cstdint>
#include <vector>

#include "adjust/models/shared_places.h"
#include "io/evaluation/parts.h"

namespace megablock {

// All arrays [models] in the order of the models' numbers.
struct LinkedModels {
  std::vector<Model> models;            // what they hold by its number and about `centre`
  std::vector<std::int32_t> given;      // row where it was given
  std::vector<Eigen::Vector3d> centre;  // centroid of what a model holds
  std::vector<Similarity> similarity;   // of what is about the centre -> frame of its part
  std::vector<std::int32_t> reference;  // the model whose frame is the part's: the lowest, held at its centre
  std::vector<SharedPlace> places;      // within parts
  std::vector<ModelLink> links;         // a, b: rows here; of what is about the centres

  // One for each reference.
  std::vector<std::uint8_t> held() const;
  // By the solution of these equations; the longest step of a model in the metric of its own equations. Throws
  // ComputeError for steps that are not finite.
  double move(const SimilarityEquations& equations);
  // What hangs together by links that are kept becomes a part in the frame of its lowest model; places of several
  // parts are split. The models of a part stay as they are to one another.
  void find_parts();
};

// Linked, and chained along the most trusted links; models that nothing links are parts of their own. Throws InputError
// for numbers that are not finite, sigmas that are not positive, numbers given twice.
LinkedModels link_models(const std::vector<Model>& models, const LinkOptions& options);

// Averages the similarities over all links from where they are, drops the links that contradict the result, and finds
// the parts anew. Throws ComputeError where the links do not determine the similarities.
void average_links(LinkedModels& linked, const LinkOptions& options);

// How many times larger than their sigmas say squares of these degrees of freedom are, by their median; at least 1.
double inflation(const std::vector<double>& squares, int degrees);

}  // namespace megablock
