// Coarse bundle adjustment of initial orientation: the tile's residuals over the graph's tracks, solved by Ceres.
#pragma once

#include "adjust/orientation/steps/track_intersection.h"
#include "adjust/problem/tile_problem.h"

namespace megablock {

struct CoarseOptions {
  ObservationOptions observations;         // sigma and priors; the loss below replaces theirs
  double loss_scale_px = 4;                // Cauchy scale of image residuals
  std::vector<ParameterMask> camera_free;  // [graph.cameras] refined intrinsics
  int max_iterations = 20;
  double function_tolerance = 1e-4;
};

// Adjusts oriented frames, points and the free intrinsics over the kept observations; given frames stay. Throws
// ComputeError when Ceres finds no usable solution.
void adjust_coarsely(const Block& block, const OrientationGraph& graph, const CoarseOptions& options,
                     OrientationValues& values);

}  // namespace megablock
