// Estimates variance components of positions, attitudes, relative poses and verticals, where stated sigmas are not to
// be trusted: their sigmas are multiplied by factors that follow from their residuals. image_sigma.h does so for image
// observations.
#pragma once

#include "adjust/terms/terms.h"

namespace megablock {

// The factors by which the sigmas of a block must be multiplied. The block was adjusted with `now` times the stated
// sigmas. The factor is 1 for kinds whose sigmas are not estimated, and for a redundancy below 30, where its own sigma
// would be more than 13 %. No sigma falls below the stated one, because an error that neighbouring frames share, as in
// trajectories, hardly shows in residuals.
SigmaScales next_sigma_scales(const SigmaScales& now, const ObservationTable& table);

// Multiplies the sigmas of the observations of the problem.
void scale_sigmas(TileProblem& problem, const SigmaScales& scales);

}  // namespace megablock
