// Computes one vector for each image from its SIFT descriptors. It serves to find images of the same place without
// positions.
#pragma once

#include <array>
#include <vector>

#include "io/block/features.h"

namespace megablock {

// Returns a vector of unit norm (zero for an image without features). It does not depend on the order of the
// descriptors, nor on the rotation and scale of the image. The scalar product of two vectors grows with the similarity
// of the images.
std::array<float, 128> global_descriptor(const std::vector<SiftDescriptor>& descriptors);

}  // namespace megablock
