// Adjusts the oriented frames, points and cameras of the initial orientation together. It takes the residuals of a tile
// (tile_problem.h) over the tracks of the graph and solves them with Ceres to a loose tolerance.
// Internal to adjust/: it is not installed.
#pragma once

#include "adjust/orientation/steps/track_intersection.h"
#include "adjust/problem/tile_problem.h"

namespace megablock {

struct CoarseOptions {
  ObservationOptions observations;         // sigmas and priors; the loss below replaces theirs
  bool use_positions = true;               // of the graph; false before the block is in their coordinate frame
  double loss_scale_px = 4;                // Cauchy scale of image residuals
  std::vector<ParameterMask> camera_free;  // [graph.cameras] refined intrinsics
  int max_iterations = 20;
  double function_tolerance = 1e-4;
};

// Adjusts the oriented frames, the points and the free camera parameters to the kept observations. Given frames keep
// their poses. Throws ComputeError when Ceres finds no usable solution.
void adjust_coarsely(const Block& block, const OrientationGraph& graph, const CoarseOptions& options,
                     OrientationValues& values);

}  // namespace megablock
