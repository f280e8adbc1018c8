// Prior sigmas of cameras of which nothing but a start value is known.
#pragma once

#include "io/block/block.h"

namespace megablock {

// Prior sigmas that keep self-calibration of small blocks stable (weak_sigmas); the focal length is good for 5 %, 30 %
// when guessed.
IntrinsicSigmas default_intrinsic_sigmas(const Camera& camera);

}  // namespace megablock
