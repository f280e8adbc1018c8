// Variance components of everything but image measurements (those: image_sigma.h), where stated sigmas are not to be
// trusted: sigmas of positions, attitudes, relative poses and verticals are multiplied by what their residuals show.
#pragma once

#include "adjust/terms/terms.h"

namespace megablock {

// What to multiply the sigmas with that a block was adjusted with (`now` times the stated ones). Kinds with a
// redundancy below 30 (the factor would not be good to 13 %) and those whose sigmas are not estimated: 1. No sigma
// falls below the stated one: an error that neighbouring frames share, as those of trajectories are, hardly shows in
// residuals.
SigmaScales next_sigma_scales(const SigmaScales& now, const ObservationTable& table);

// Multiplies the sigmas of the problem's terms.
void scale_sigmas(TileProblem& problem, const SigmaScales& scales);

}  // namespace megablock
