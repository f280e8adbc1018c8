// Fits groups of positions to an oriented block, each group with an offset of its own: the mathematics of
// position_shifts.h.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "geometry/similarity/similarity.h"
#include "io/block/block.h"

namespace megablock {

struct AntennaPair {
  FrameIndex frame;
  Eigen::Vector3d in_block, observed;  // antenna, metres
  Eigen::Vector3d sigma;               // stated, metres
};

// A division of the pairs into groups. Group 0 is the largest, and -1 takes no part.
struct Division {
  std::vector<int> group;          // [pairs]
  std::vector<std::string> names;  // [groups]
  bool chosen = false;             // among many
};

// The similarity of all groups and the offset of each, metres.
struct ShiftFit {
  Similarity similarity;                                                              // to the datum of group 0
  std::vector<Eigen::Vector3d> offsets;                                               // [groups] o_g
  std::vector<Eigen::Vector3d> residuals;                                             // [pairs] p - s R x - t - o_g
  Eigen::Vector3d mean = Eigen::Vector3d::Zero(), scatter = Eigen::Vector3d::Zero();  // of |r|; s
};

// Empty where the pairs have no extent. Each group needs a pair.
std::optional<ShiftFit> fit_shifts(const std::vector<AntennaPair>& pairs, const Division& division);

// The mean length of the residuals along each axis that a bend of the block leaves, with weights as those of the fit.
// The bend is a polynomial of the second order in the two directions in which the block extends most.
Eigen::Vector3d mean_beside_bend(const std::vector<AntennaPair>& pairs, const std::vector<Eigen::Vector3d>& residuals);

}  // namespace megablock
