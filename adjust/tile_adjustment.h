// Bundle adjustment of one tile with Ceres: triangulation, screening that re-tests and restores, self-calibration.
#pragma once

#include <string>
#include <vector>

#include "adjust/tile_problem.h"
#include "io/unit_files.h"

namespace megablock {

struct AdjustOptions {
  ObservationOptions observations;
  // Parameters estimated where the camera's prior sigma allows: all of them, or fewer on small blocks (the smallest
  // set that the number of images supports is chosen when empty).
  double min_intersection_deg = 1.5;  // points below are held out of the adjustment and kept in the store
  double max_residual_sigmas = 4.0;   // screening threshold at the end; starts at 8 x and falls
  int screening_rounds = 3;           // re-tests every observation against the current solution, both ways
  int max_iterations = 50;            // of Ceres per round
  void check() const;                 // throws InputError
};

// Intersects all rays of every active point (linear start, Gauss-Newton refinement); NaN where it fails.
// Sets kept = 0 on the observations of points that fail, that are behind a camera, or below min_intersection_deg.
void triangulate_points(TileProblem& problem, TileState& state, const AdjustOptions& options);

// Re-tests every observation (also rejected ones) of every point against the current solution; returns how many changed.
// Threshold in sigmas. A rejected observation comes back when it passes; a point whose observations split into
// consistent parts keeps the larger one.
std::int64_t screen_observations(TileProblem& problem, TileState& state, double threshold_sigmas,
                                 const AdjustOptions& options);

struct AdjustSummary {
  double initial_cost = 0, final_cost = 0, sigma0 = 0;
  std::int64_t observations = 0, points = 0, rejected = 0, restored = 0;
  bool usable = false;
  std::string text;  // one line
};

// One Ceres solve of the problem as it stands (one thread, deterministic). Free gauge: the pose of the first frame and
// the distance to the farthest frame are held when no prior fixes the datum.
AdjustSummary solve_with_ceres(const TileProblem& problem, TileState& state, int max_iterations,
                               double function_tolerance = 1e-6);

// The whole tile adjustment: triangulate, solve, screen, solve ... Throws ComputeError when nothing can be adjusted.
AdjustSummary adjust_tile(TileProblem& problem, TileState& state, const AdjustOptions& options);

}  // namespace megablock
