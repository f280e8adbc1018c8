// Holds matched points of two images, the input of all solvers and estimators of this folder.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace megablock {

// Normalised image points (X/Z, Y/Z) without distortion. Element i of a matches element i of b.
struct PointPairs {
  std::vector<Eigen::Vector2d> a, b;
  std::size_t size() const { return a.size(); }
};

}  // namespace megablock
