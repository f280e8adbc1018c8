// Puts the assembly back into the coordinates that were given. Inside, a model has coordinates about its centroid c_m,
// so that rotation, scale and shift of a step are nearly uncorrelated, and models may have any numbering. With S the
// similarity about the centroids,
//
//     given model -> common frame:  X = S (x - c_m),
//     a step about the origin of b as one about its centroid:  w, q as they are,  d + w x c_b + q c_b.
#include "adjust/independent_models/model_assembly.h"

#include <cmath>

#include "adjust/independent_models/linked_models.h"
#include "adjust/independent_models/place_adjustment.h"
#include "geometry/transform/rotation.h"
#include "io/base/error.h"

namespace megablock {

void AssemblyOptions::check() const {
  links.check();
  if (max_iterations < 1) throw InputError("assembly: max_iterations must be at least 1");
}

namespace {

// The link about the models' origins, with the rows of the given models.
ModelLink as_given(const LinkedModels& linked, ModelLink link) {
  const Eigen::Vector3d &a = linked.centre[nth(link.a)], &b = linked.centre[nth(link.b)];
  Similarity& s = link.similarity;
  s.translation += a - s.scale * (s.rotation * b);
  // Turns a step xi about the origin of b into one about its centroid.
  Block7 about_centroid = Block7::Identity();
  about_centroid.bottomLeftCorner<3, 4>() << -skew(b), b;
  link.information = about_centroid.transpose() * link.information * about_centroid;
  link.a = linked.given[nth(link.a)];
  link.b = linked.given[nth(link.b)];
  return link;
}

AssembledModels assembled(const LinkedModels& linked, const PlaceAdjustment& adjusted) {
  AssembledModels result;
  const std::size_t count = linked.models.size();
  result.similarity.resize(count);
  result.part.resize(count);
  result.covariance.resize(adjusted.covariance.size());
  for (std::size_t m = 0; m < count; ++m) {
    const std::size_t row = nth(linked.given[m]);
    Similarity whole = linked.similarity[m];
    whole.translation -= whole.scale * (whole.rotation * linked.centre[m]);
    // The reference is the identity by definition; its bits would differ by the rounding of the shift to and fro.
    if (linked.reference[m] == static_cast<std::int32_t>(m)) whole = Similarity();
    result.similarity[row] = whole;
    result.part[row] = linked.models[nth(linked.reference[m])].number;
    if (adjusted.covariance.empty()) continue;
    Block7 to_common = Block7::Identity();
    // A step's d is in units and axes of the model, the shift of similarity.h in those of the common frame.
    to_common.bottomRightCorner<3, 3>() = whole.scale * whole.rotation.toRotationMatrix();
    result.covariance[row] =
        covariance_about_origin(whole, linked.centre[m], to_common * adjusted.covariance[m] * to_common.transpose());
  }
  for (const ModelLink& link : linked.links) result.links.push_back(as_given(linked, link));
  for (const SharedPlace& place : linked.places)
    for (const auto& e : place.entries) ++result.shared, result.rejected += !e.kept;
  result.lost = adjusted.lost;
  result.iterations = adjusted.iterations;
  result.converged = adjusted.converged;
  result.redundancy = adjusted.redundancy;
  if (adjusted.redundancy > 0)
    result.sigma0 = std::sqrt(adjusted.weighted_squares / static_cast<double>(adjusted.redundancy));
  return result;
}

}  // namespace

AssembledModels assemble_models(const std::vector<Model>& models, const AssemblyOptions& options) {
  options.check();
  LinkedModels linked = link_models(models, options.links);
  PlaceAdjustment adjusted;
  if (options.joint) {
    average_links(linked, options.links);
    adjusted =
        adjust_places(linked, {options.links.rejection_probability, options.max_iterations, options.covariances});
  }
  return assembled(linked, adjusted);
}

}  // namespace megablock
