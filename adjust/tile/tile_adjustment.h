// Adjusts one tile: intersects its points, estimates frames, points and cameras, and screens the observations.
// Screening tests every observation again in each round, so that a rejected one may come back.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "adjust/problem/tile_problem.h"

namespace megablock {

struct AdjustOptions {
  ObservationOptions observations;
  // Points whose rays meet at a smaller angle are left out of the adjustment and kept in the store.
  double min_intersection_deg = 1.5;
  // Estimates the sigma of the tie points from their residuals (image_sigma.h), beginning with image_sigma_px.
  bool estimate_image_sigma = true;
  double max_residual_sigmas = 4.0;  // screening threshold at the end; it falls from 8 times this value
  int screening_rounds = 3;  // each tests every observation against the current solution, kept and rejected ones
  int max_iterations = 50;   // of the solver in each round
  bool only_start = false;   // the adjustment of the block follows, so that coming near the tile's optimum is enough
  // The numbers of images that a camera needs in the tile before the adjustment of the tile estimates parameters
  // without a prior sigma: focal length and k1; principal point, k2 and decentring; k3. With fewer images the
  // parameters keep their values here, and the adjustment of the whole block estimates them (TileProblem::camera_free
  // is never changed).
  int min_images_focal = 3, min_images_principal = 10, min_images_radial3 = 20;
  void check() const;  // throws InputError
};

// Intersects all rays of every active point (linear start, Gauss-Newton refinement). A point is NaN where this fails.
// Sets kept = 0 for the observations of points that fail, that are behind a camera, or whose rays meet below
// min_intersection_deg.
void triangulate_points(TileProblem& problem, TileState& state, const AdjustOptions& options);
// The same for the points marked in `which` [points].
void triangulate_points(TileProblem& problem, TileState& state, const AdjustOptions& options,
                        const std::vector<std::uint8_t>& which);

// Tests every observation of every point, rejected ones too, against the current solution, with a threshold in sigmas.
// Returns the number of changes. A rejected observation comes back when it passes. A point whose observations split
// into consistent parts keeps the largest one.
std::int64_t screen_observations(TileProblem& problem, TileState& state, double threshold_sigmas,
                                 const AdjustOptions& options);
// The same for the points marked in `which` [points]; the other points stay unchanged.
std::int64_t screen_observations(TileProblem& problem, TileState& state, double threshold_sigmas,
                                 const AdjustOptions& options, const std::vector<std::uint8_t>& which);

// The final screening threshold of a tile, in sigmas, with which adjust_tile ends. It is max_residual_sigmas, raised
// where the median of the kept residuals shows that the a-priori sigma is too small for these images.
double screening_threshold(const TileProblem& problem, const TileState& state, const AdjustOptions& options);

struct AdjustSummary {
  double initial_cost = 0, final_cost = 0;
  // Square root of the weighted squares of kept residuals / (residuals - unknowns + datum defect).
  double sigma0 = 0;
  int iterations = 0;
  std::int64_t observations = 0, points = 0;
  std::int64_t degrees_of_freedom = 0;  // residuals - unknowns + datum defect
  std::int64_t rejected = 0;  // observations that take no part in the end, with those of points that are left out
  std::int64_t restored = 0;  // rejected observations that came back in a later round
  bool usable = false;
  std::string text;  // one line
};

// When the solver of a tile ends, and which cameras it estimates.
struct SolveOptions {
  int max_iterations = 50;
  double function_tolerance = 1e-6;        // ends when a step lowers the cost by a smaller share
  std::vector<ParameterMask> camera_free;  // estimated intrinsics per camera; empty = problem.camera_free
};

// Adjusts the problem of a tile as it is, from the given state. A datum that the observations leave free is fixed by
// minimal constraints at the start values. Every active point must be in front of its cameras; otherwise the summary is
// not `usable` and the state stays unchanged. Throws ComputeError when there is nothing to adjust.
using TileSolver = std::function<AdjustSummary(const TileProblem&, TileState&, const SolveOptions&)>;

// Fills the summary of a solution except for costs and iterations. `unknowns` counts scalar unknowns, points included;
// `datum_defect` is that of the observations.
void describe_solution(const TileProblem& problem, const TileState& state, std::int64_t unknowns,
                       std::int64_t datum_defect, AdjustSummary& summary);

// Solves by Ceres, with one thread, deterministically. It is the reference, and the solver of the callers in this room.
// merge/ has a faster solver (tile_solver.h).
AdjustSummary solve_with_ceres(const TileProblem& problem, TileState& state, const SolveOptions& options);
AdjustSummary solve_with_ceres(const TileProblem& problem, TileState& state, int max_iterations,
                               double function_tolerance = 1e-6);

// The whole adjustment of a tile: intersects points, solves, screens, solves again ... Throws ComputeError when nothing
// can be adjusted.
AdjustSummary adjust_tile(TileProblem& problem, TileState& state, const AdjustOptions& options,
                          const TileSolver& solver);
AdjustSummary adjust_tile(TileProblem& problem, TileState& state, const AdjustOptions& options);  // with Ceres

}  // namespace megablock
