// Projection centres and points together, from rays of known rotation and position priors.
//
// With v the unit ray of an observation in ground axes, minimises
//
//     sum rho(|v - d (X - C)|^2 / sigma^2) + position priors,   d = 1 / |X - C|,
//
// over all centres C and points X: residuals are chords between unit vectors, so that near and far points weigh alike
// and a point behind its camera still has a gradient. After Pan, Barath, Pollefeys and Schoenberger, "Global
// structure-from-motion revisited", ECCV 2024, who leave d free to start at random; here the start is measured
// (baselines.h), and d is eliminated.
#pragma once

#include "adjust/orientation/steps/track_intersection.h"

namespace megablock {

struct PositioningOptions {
  double ray_sigma_rad = 0.01;  // of rays turned by averaged rotations
  bool use_positions = true;    // priors of the graph's frames
  int max_iterations = 15;
};

// Improves the centres of the oriented frames and the points; rotations stay. Given frames stay.
void position_globally(const OrientationGraph& graph, const std::vector<Eigen::Vector3d>& rays,
                       const PositioningOptions& options, OrientationValues& values);

}  // namespace megablock
