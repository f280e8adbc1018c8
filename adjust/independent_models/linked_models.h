// Links independent models by the points and images that they share, and gives a start for their joint adjustment
// (Kalantari 2009, chapter 9: models joined by similarities).
//
// Every two models that share points or images get a robust similarity (model_link.h). The trust in a link is its
// number of inliers times the share of its triangles that close within their covariances. The spanning tree of the most
// trusted links gives the first similarities; its errors add up along the tree. Averaging then uses all links together,
// in least squares with their covariances P^-1. For a link b -> a and the steps xi of its models,
//
//     e = Log(S_ba^-1 S_a^-1 S_b),     e -> e + xi_b - T xi_a  (T: a's frame -> b's),     sum w(e) e' P e = min
//
// with the weights w = (1 + e' P e / c)^-2 of Geman and McClure against outliers. Their width c follows the median
// misfit.
// Internal to adjust/: it is not installed.
#pragma once

#include <cstdint>
#include <vector>

#include "adjust/independent_models/shared_places.h"
#include "io/evaluation/parts.h"

namespace megablock {

// All arrays [models] in the order of the models' numbers.
struct LinkedModels {
  std::vector<Model> models;            // their coordinates are about `centre`, and ascending by number
  std::vector<std::int32_t> given;      // row in the given list
  std::vector<Eigen::Vector3d> centre;  // centroid of the model's points and images
  std::vector<Similarity> similarity;   // from coordinates about the centre to the frame of the part
  std::vector<std::int32_t> reference;  // the model whose frame is that of the part: the lowest one, held at its centre
  std::vector<SharedPlace> places;      // shared places within parts
  std::vector<ModelLink> links;         // a, b: rows here; between coordinates about the centres

  // 1 for each reference model, which is held.
  std::vector<std::uint8_t> held() const;
  // Moves the models by the solution of these equations. Returns the longest step of a model in the metric of its own
  // equations. Throws ComputeError for steps that are not finite.
  double move(const SimilarityEquations& equations);
  // Makes the models that kept links connect a part, in the frame of its lowest model, and splits shared points and
  // images that lie in several parts. The models of a part keep their places relative to one another.
  void find_parts();
};

// Links the models and chains them along the most trusted links. A model without links is a part of its own. Throws
// InputError for values that are not finite, sigmas that are not positive, and numbers given twice.
LinkedModels link_models(const std::vector<Model>& models, const LinkOptions& options);

// Averages the similarities over all links, beginning with the present ones. Drops the links that contradict the result
// and finds the parts anew. Throws ComputeError where the links do not determine the similarities.
void average_links(LinkedModels& linked, const LinkOptions& options);

// The factor by which squares with these degrees of freedom exceed their expectation, from their median; at least 1.
double inflation(const std::vector<double>& squares, int degrees);

}  // namespace megablock
