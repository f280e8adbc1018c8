// Turns the rays of a simulated pair (pair_scene.h) into normalised image points.
#pragma once

#include "geometry/two_view/point_pairs.h"
#include "pair_scene.h"

namespace megablock {

inline PointPairs normalised_points(const PairScene& scene) {
  PointPairs points;
  for (std::size_t i = 0; i < scene.a.size(); ++i) {
    points.a.emplace_back(scene.a[i].hnormalized());
    points.b.emplace_back(scene.b[i].hnormalized());
  }
  return points;
}

}  // namespace megablock
