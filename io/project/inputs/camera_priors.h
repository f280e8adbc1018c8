// Gives prior standard deviations to cameras for which only initial values are known.
#pragma once

#include "io/block/block.h"

namespace megablock {

// Priors that keep the self-calibration of small blocks stable (weak_sigmas). The focal length is taken as accurate to
// 5 %, or to 30 % if it is a guess.
IntrinsicSigmas default_intrinsic_sigmas(const Camera& camera);
// The same for the parameters that are named, 0 for the others.
IntrinsicSigmas default_intrinsic_sigmas(const Camera& camera, ParameterMask which);

}  // namespace megablock
