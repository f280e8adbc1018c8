// Gives the sigmas of positions and control points with which a block was adjusted: the stated ones times the factors
// of the result (ObservationStatistics::scale), which differ from one where the merge has scaled them.
#pragma once

#include "io/result/result.h"

namespace megablock {

// East, north, up; metres. The control of a survey has one quality, so that check points have the factors of the
// control points.
inline Eigen::Vector3d used_sigma(const BlockResult& result, const ControlPoint& point) {
  const double across = result.observation_table[ObservationKind::kControlHorizontal].scale;
  const double up = result.observation_table[ObservationKind::kControlHeight].scale;
  return point.sigma.cwiseProduct(Eigen::Vector3d(across, across, up));
}

// A group of positions may have factors of its own. An invalid group: positions without one.
inline PositionScale position_scale(const BlockResult& result, RigIndex group) {
  for (const PositionScale& scale : result.position_scales)
    if (scale.group == group) return scale;
  return {group, result.observation_table[ObservationKind::kPositionHorizontal].scale,
          result.observation_table[ObservationKind::kPositionHeight].scale};
}

inline Eigen::Vector3d used_sigma(const BlockResult& result, const PositionPrior& prior) {
  const PositionScale scale = position_scale(result, prior.group);
  return prior.sigma.cwiseProduct(Eigen::Vector3d(scale.horizontal, scale.horizontal, scale.height));
}

}  // namespace megablock
