// Improves projection centres and points together, with rotations held, from the viewing rays and the position priors.
//
// With v the unit ray of an observation in ground axes it minimises
//
//     sum rho(|v - d (X - C)|^2 / sigma^2) + position priors,   d = 1 / |X - C|,
//
// over all centres C and points X. The residuals are chords between unit vectors. So near and far points have the same
// weight, and a point behind its camera still has a gradient. The method is that of L. Pan, D. Barath, M. Pollefeys and
// J. Schoenberger, "Global structure-from-motion revisited", ECCV 2024. They keep d as an unknown to start at random;
// here baselines.h gives the start, and d is eliminated.
// Internal to adjust/: it is not installed.
#pragma once

#include "adjust/orientation/steps/track_intersection.h"

namespace megablock {

struct PositioningOptions {
  double ray_sigma_rad = 0.01;  // of rays turned by averaged rotations
  bool use_positions = true;    // priors of the graph's frames
  int max_iterations = 15;
};

// Moves the centres of the oriented frames and the points of `values`. Rotations and given frames stay.
void position_globally(const OrientationGraph& graph, const std::vector<Eigen::Vector3d>& rays,
                       const PositioningOptions& options, OrientationValues& values);

}  // namespace megablock
