// Prior sigmas that keep parameters from running away which the images do not determine, and that say nothing about
// those that they do.
#pragma once

#include "geometry/camera/intrinsics.h"

namespace megablock {

// Ten times weak_sigmas(); terms of radial corrections are loose at the corner of the image, however long the lens
// (there a correction of 2 half diagonals). Focal length: none (0, as for fixed parameters).
IntrinsicSigmas loose_sigmas(const Intrinsics& start, int width, int height);

}  // namespace megablock
