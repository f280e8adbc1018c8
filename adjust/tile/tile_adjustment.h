// Bundle adjustment of one tile: triangulation, screening that re-tests and restores, self-calibration.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "adjust/problem/tile_problem.h"

namespace megablock {

struct AdjustOptions {
  ObservationOptions observations;
  double min_intersection_deg = 1.5;  // points below are held out of the adjustment and kept in the store
  bool estimate_image_sigma = true;  // of tie points, from their residuals (image_sigma.h); image_sigma_px is the start
  double max_residual_sigmas = 4.0;  // screening threshold at the end; starts at 8 x and falls
  int screening_rounds = 3;          // re-tests every observation against the current solution, both ways
  int max_iterations = 50;           // of the solver per round
  bool only_start = false;           // a block's adjustment follows: near the tile's optimum is enough
  // Images a camera needs in the tile before the tile's own adjustment estimates parameters without a prior sigma:
  // focal length and k1; principal point, k2 and decentring; k3. Below, they stay at their values here and are left to
  // the adjustment of the whole block (TileProblem::camera_free is never changed).
  int min_images_focal = 3, min_images_principal = 10, min_images_radial3 = 20;
  void check() const;  // throws InputError
};

// Intersects all rays of every active point (linear start, Gauss-Newton refinement); NaN where it fails.
// Sets kept = 0 on the observations of points that fail, that are behind a camera, or below min_intersection_deg.
void triangulate_points(TileProblem& problem, TileState& state, const AdjustOptions& options);
// The same for the points marked in `which` [points].
void triangulate_points(TileProblem& problem, TileState& state, const AdjustOptions& options,
                        const std::vector<std::uint8_t>& which);

// Re-tests every observation (also rejected ones) of every point against the current solution; returns how many
// changed. Threshold in sigmas. A rejected observation comes back when it passes; a point whose observations split into
// consistent parts keeps the larger one.
std::int64_t screen_observations(TileProblem& problem, TileState& state, double threshold_sigmas,
                                 const AdjustOptions& options);
// The same for the points marked in `which` [points]; the others are left as they are.
std::int64_t screen_observations(TileProblem& problem, TileState& state, double threshold_sigmas,
                                 const AdjustOptions& options, const std::vector<std::uint8_t>& which);

// The final screening threshold of a tile, in sigmas: max_residual_sigmas, raised where the kept residuals show (by
// their median) that the a-priori sigma is too small for these images. What adjust_tile ends with.
double screening_threshold(const TileProblem& problem, const TileState& state, const AdjustOptions& options);

struct AdjustSummary {
  double initial_cost = 0, final_cost = 0;
  // Square root of the weighted squares of kept residuals / (residuals - unknowns + datum defect).
  double sigma0 = 0;
  int iterations = 0;
  std::int64_t observations = 0, points = 0;
  std::int64_t degrees_of_freedom = 0;  // residuals - unknowns + datum defect
  std::int64_t rejected = 0;            // observations that take no part in the end (points held out included)
  std::int64_t restored = 0;            // observations that came back in a later round
  bool usable = false;
  std::string text;  // one line
};

struct SolveOptions {
  int max_iterations = 50;
  double function_tolerance = 1e-6;        // ends with a step that lowers the cost by less, relatively
  std::vector<ParameterMask> camera_free;  // estimated intrinsics per camera; empty = problem.camera_free
};

// Adjusts a tile's problem as it stands, from the state at hand. A datum that the observations leave free is fixed by
// minimal constraints at the start values. Every active point must be in front of its cameras, otherwise the summary is
// not `usable` and the state stays. Throws ComputeError when there is nothing to adjust.
using TileSolver = std::function<AdjustSummary(const TileProblem&, TileState&, const SolveOptions&)>;

// What a solver says of its solution besides costs and iterations. `unknowns`: scalar ones, points included;
// `datum_defect`: of the observations.
void describe_solution(const TileProblem& problem, const TileState& state, std::int64_t unknowns,
                       std::int64_t datum_defect, AdjustSummary& summary);

// The reference, and the solver of the callers within this room: Ceres, one thread, deterministic. merge/ has a faster
// one (tile_solver.h).
AdjustSummary solve_with_ceres(const TileProblem& problem, TileState& state, const SolveOptions& options);
AdjustSummary solve_with_ceres(const TileProblem& problem, TileState& state, int max_iterations,
                               double function_tolerance = 1e-6);

// The whole tile adjustment: triangulate, solve, screen, solve ... Throws ComputeError when nothing can be adjusted.
AdjustSummary adjust_tile(TileProblem& problem, TileState& state, const AdjustOptions& options,
                          const TileSolver& solver);
AdjustSummary adjust_tile(TileProblem& problem, TileState& state, const AdjustOptions& options);  // with Ceres

}  // namespace megablock
