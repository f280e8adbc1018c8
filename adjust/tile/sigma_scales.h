// Variance components of everything but image measurements (those: image_sigma.h), where stated sigmas are not to be
// trusted: sigmas of positions, attitudes, relative poses and verticals are multiplied by what their residuals show.
#pragma once

#include <array>

#include "adjust/problem/tile_problem.h"
#include "io/block/observation_statistics.h"

namespace megablock {

// Factor of the sigmas of each kind of observation.
struct SigmaScales {
  std::array<double, kObservationKinds> of;
  SigmaScales() { of.fill(1); }
  double& operator[](ObservationKind kind) { return of[static_cast<std::size_t>(kind)]; }
  double operator[](ObservationKind kind) const { return of[static_cast<std::size_t>(kind)]; }
  // Whether a factor is more than 2 % off 1.
  bool matter() const;
};

// What to multiply the sigmas with that a block was adjusted with (`now` times the stated ones). Kinds with a
// redundancy below 30 (the factor would not be good to 13 %) and those whose sigmas are not estimated: 1. No sigma
// falls below the stated one: an error that neighbouring frames share, as those of trajectories are, hardly shows in
// residuals.
SigmaScales next_sigma_scales(const SigmaScales& now, const ObservationTable& table);

// Multiplies the sigmas of the problem's terms.
void scale_sigmas(TileProblem& problem, const SigmaScales& scales);

}  // namespace megablock
