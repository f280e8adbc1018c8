// Matched points of two images.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace megablock {

// Normalised image points (X/Z, Y/Z), row i of a matched to row i of b.
struct PointPairs {
  std::vector<Eigen::Vector2d> a, b;
  std::size_t size() const { return a.size(); }
};

}  // namespace megablock
