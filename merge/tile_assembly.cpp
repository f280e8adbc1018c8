#include "merge/tile_assembly.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>

#include "adjust/model_assembly.h"
#include "io/error.h"

namespace megablock {

namespace {

double extent_of(const AlignmentTile& tile) {
  Eigen::AlignedBox3d box;
  for (const Pose& pose : tile.poses) box.extend(pose.centre);
  return box.isEmpty() ? 0 : box.diagonal().norm();
}

// How good a frame is in its tile goes by its observations; how good all of them are each link finds by itself.
Model model_of(const AlignmentTile& tile, std::size_t number) {
  constexpr double kOrder = 1e-6;  // of the extent, and rad: smaller than any misfit, as links only enlarge sigmas
  Model model;
  model.number = static_cast<std::int64_t>(number);
  const double extent = extent_of(tile);
  if (!(extent > 0)) return model;
  for (std::size_t i = 0; i < tile.frames.size(); ++i) {
    if (tile.observations[i] < kFewestAlignmentObservations) continue;
    const double order = kOrder / std::sqrt(static_cast<double>(tile.observations[i]));
    model.images.push_back({tile.frames[i].value, tile.poses[i], order * extent, order});
  }
  return model;
}

// Robust, as single frames may have moved.
Similarity onto_orientation(const std::vector<Eigen::Vector3d>& from, const std::vector<Eigen::Vector3d>& to) {
  constexpr double kSigmaShare = 1e-3;  // of the extent: what the initial orientation is good for
  Eigen::AlignedBox3d extent;
  for (const Eigen::Vector3d& place : to) extent.extend(place);
  const std::vector<double> sigma(from.size(), to.empty() ? 0 : kSigmaShare * extent.diagonal().norm());
  return fit_similarity_robust(from, to, sigma).value_or(Similarity());
}

struct Places {
  std::vector<Eigen::Vector3d> from, to;
};

}  // namespace

std::vector<Similarity> assemble_tiles(const std::vector<AlignmentTile>& tiles,
                                       const IndexedVector<FrameIndex, Pose>& oriented) {
  std::vector<Model> models;
  for (std::size_t t = 0; t < tiles.size(); ++t) models.push_back(model_of(tiles[t], t));
  AssemblyOptions options;
  options.covariances = false;
  options.links.scale_sigmas = true;
  AssembledModels assembled;
  assembled.similarity.resize(tiles.size());
  for (std::size_t t = 0; t < tiles.size(); ++t) assembled.part.push_back(static_cast<std::int64_t>(t));
  try {
    assembled = assemble_models(models, options);
  } catch (const ComputeError&) {  // each on its own
  }
  std::map<std::int64_t, Places> parts;
  for (std::size_t t = 0; t < tiles.size(); ++t) {
    Places& part = parts[assembled.part[t]];
    for (std::size_t i = 0; i < tiles[t].frames.size(); ++i) {
      part.from.push_back(assembled.similarity[t](tiles[t].poses[i].centre));
      part.to.push_back(oriented[tiles[t].frames[i]].centre);
    }
  }
  std::map<std::int64_t, Similarity> moved;
  for (const auto& [number, part] : parts) moved[number] = onto_orientation(part.from, part.to);
  std::vector<Similarity> result;
  for (std::size_t t = 0; t < tiles.size(); ++t)
    result.push_back(moved.at(assembled.part[t]) * assembled.similarity[t]);
  return result;
}

}  // namespace megablock
