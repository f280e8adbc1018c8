// First projection centres from averaged rotations, linear and without a random start.
//
//  1. Direction t of each pair's baseline: the rays w_a, w_b of a common track (ground axes) and the baseline are
//     coplanar, t . (w_a x w_b) = 0; smallest eigenvector, reweighted. Rays turned by averaged rotations leave nothing
//     of the coupling between rotation and translation of single pairs, nor of the two solutions over a plane.
//  2. Depths of the common tracks in units of the baseline. Two pairs that share an image see the same depths there:
//     the median ratio of their common tracks is the ratio of their baselines. The logarithms of the baselines follow
//     from all ratios (L1), so motion along one line is no special case (Cui and Tan, "Global structure-from-motion by
//     similarity averaging", ICCV 2015).
//  3. C_b - C_a = s t for all pairs, with positions known from elsewhere when there are any, reweighted least squares.
#pragma once

#include <optional>
#include <vector>

#include "adjust/orientation/steps/orientation_graph.h"

namespace megablock {

struct Baseline {
  std::int32_t a = -1, b = -1;  // rows of graph.images
  Eigen::Vector3d direction;    // unit, from a to b, ground axes
  double length = 0;            // common scale of one connected part; 0: unknown
  double sigma = 0;             // of the direction, rad, as the pair's own matches give it; 0: not known
};

// `rotations` [images], ground -> camera, empty where unknown; `usable` [edges]; rays [observations] in camera axes.
// Only baselines whose length is known are returned (those of the largest part).
std::vector<Baseline> measure_baselines(const OrientationGraph& graph,
                                        const std::vector<std::optional<Eigen::Quaterniond>>& rotations,
                                        const std::vector<std::uint8_t>& usable,
                                        const std::vector<Eigen::Vector3d>& rays);

// Step 3. C_b - C_a = offset with sigma relative_sigma * length.
struct CentreDifference {
  std::int32_t a = -1, b = -1;  // nodes
  Eigen::Vector3d offset;
  double sigma = 1;
};
struct CentrePrior {
  Eigen::Vector3d position, sigma;
};
// [nodes]; empty for nodes that nothing connects: to a prior, or without priors to the largest part (its lowest node is
// the origin). `start` [nodes] or empty: known approximately, weights the first iteration.
std::vector<std::optional<Eigen::Vector3d>> solve_centres(
    std::int32_t nodes, const std::vector<CentreDifference>& differences,
    const std::vector<std::optional<CentrePrior>>& priors,
    const std::vector<std::optional<Eigen::Vector3d>>& start = {});

}  // namespace megablock
