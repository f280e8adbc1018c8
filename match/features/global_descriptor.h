// One vector per image from its SIFT descriptors, to find images of the same place without positions.
#pragma once

#include <array>
#include <vector>

#include "io/block/features.h"

namespace megablock {

// Unit norm (zero for an image without features). Independent of the order of the descriptors, of image rotation and
// scale. The dot product of two images' vectors grows with their likeness.
std::array<float, 128> global_descriptor(const std::vector<SiftDescriptor>& descriptors);

}  // namespace megablock
