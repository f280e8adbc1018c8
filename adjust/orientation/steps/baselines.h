// Gives first projection centres from averaged rotations. All steps are linear, so no random start is needed.
//
//  1. The direction t of each pair's baseline. The rays w_a, w_b of a common track (ground axes) and the baseline are
//     coplanar, t . (w_a x w_b) = 0, so t is the eigenvector of the smallest eigenvalue, with reweighting. The averaged
//     rotations remove the coupling of rotation and translation in single pairs and the second solution over a plane.
//  2. The lengths of the baselines. Each pair gives the depths of its tracks in units of its baseline. Two pairs that
//     share an image see the same depths there, so the median ratio over their common tracks is the ratio of their
//     baselines. The logarithms of the lengths follow from all ratios (L1). Motion along one line is no special case
//     (Z. Cui and P. Tan, "Global structure-from-motion by similarity averaging", ICCV 2015).
//  3. The centres from C_b - C_a = s t of all pairs and the known positions, by reweighted least squares.
// Internal to adjust/: it is not installed.
#pragma once

#include <optional>
#include <vector>

#include "adjust/orientation/steps/orientation_graph.h"

namespace megablock {

struct Baseline {
  std::int32_t a = -1, b = -1;  // rows of graph.images
  Eigen::Vector3d direction;    // unit, from a to b, ground axes
  double length = 0;            // common scale of one connected part; 0: unknown
  double sigma = 0;             // of the direction, rad, from the noise of the pair's matches; 0: not known
};

// Steps 1 and 2. `rotations` [images] are ground -> camera, empty where unknown. `usable` [edges] marks the edges that
// count. `rays` [observations] are in camera axes. Returns the baselines whose length is known, those of the largest
// connected part.
std::vector<Baseline> measure_baselines(const OrientationGraph& graph,
                                        const std::vector<std::optional<Eigen::Quaterniond>>& rotations,
                                        const std::vector<std::uint8_t>& usable,
                                        const std::vector<Eigen::Vector3d>& rays);

// An equation of step 3: C_b - C_a = offset, with sigma per axis.
struct CentreDifference {
  std::int32_t a = -1, b = -1;  // nodes
  Eigen::Vector3d offset;
  double sigma = 1;
};
struct CentrePrior {
  Eigen::Vector3d position, sigma;
};
// Step 3. Returns the centre of each node. It is empty where a node is not connected to a prior or, without priors, to
// the largest part, whose lowest node is the origin. `start` [nodes], or empty, holds approximate centres for the
// weights of the first iteration.
std::vector<std::optional<Eigen::Vector3d>> solve_centres(
    std::int32_t nodes, const std::vector<CentreDifference>& differences,
    const std::vector<std::optional<CentrePrior>>& priors,
    const std::vector<std::optional<Eigen::Vector3d>>& start = {});

}  // namespace megablock
