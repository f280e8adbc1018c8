// Gives prior standard deviations to cameras for which only initial values are known.
#pragma once

#include "io/block/block.h"

namespace megablock {

// The guess without any information, pixels: 1.2 times the larger side, a normal lens that sees 45 degrees.
double usual_focal_px(int width, int height);

// Priors that keep the self-calibration of small blocks stable (weak_sigmas). The focal length is taken as accurate to
// 5 %, or to 30 % if it is a guess.
IntrinsicSigmas default_intrinsic_sigmas(const Camera& camera);
// The same for the parameters that are named, 0 for the others.
IntrinsicSigmas default_intrinsic_sigmas(const Camera& camera, ParameterMask which);

}  // namespace megablock
