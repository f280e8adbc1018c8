// Gives prior sigmas of camera parameters. They are large enough not to affect parameters that the images determine,
// and small enough to hold those that they do not.
#pragma once

#include "geometry/camera/intrinsics.h"

namespace megablock {

// Ten times weak_sigmas(). The sigma of a radial term corresponds to a correction of 2 half diagonals at the corner of
// the image, whatever the focal length. The focal length has no prior (0, as for fixed parameters).
IntrinsicSigmas loose_sigmas(const Intrinsics& start, int width, int height);

}  // namespace megablock
