// Gives the sigmas of positions and control points with which a block was adjusted: the stated ones times the factors
// of the result (ObservationStatistics::scale), which differ from one where the merge has scaled them.
#pragma once

#include "io/result/result.h"

namespace megablock {

inline Eigen::Vector3d scaled_sigma(const BlockResult& result, const Eigen::Vector3d& sigma, ObservationKind horizontal,
                                    ObservationKind height) {
  const double across = result.observation_table[horizontal].scale, up = result.observation_table[height].scale;
  return sigma.cwiseProduct(Eigen::Vector3d(across, across, up));
}

// East, north, up; metres. The control of a survey has one quality, so that check points have the factors of the
// control points.
inline Eigen::Vector3d used_sigma(const BlockResult& result, const ControlPoint& point) {
  return scaled_sigma(result, point.sigma, ObservationKind::kControlHorizontal, ObservationKind::kControlHeight);
}

inline Eigen::Vector3d used_sigma(const BlockResult& result, const PositionPrior& prior) {
  return scaled_sigma(result, prior.sigma, ObservationKind::kPositionHorizontal, ObservationKind::kPositionHeight);
}

}  // namespace megablock
