// Gives the block as it was at an earlier generation, when it had fewer images. A block grows at its end: new images,
// frames, rigs and cameras follow the existing ones, so that a number of images identifies a generation
// (Job::generations).
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "io/block/block.h"

namespace megablock {

// The first n images, with the frames, rigs and cameras up to the last ones that they use, and without relative poses
// and control points.
Block first_images(const Block& block, std::int64_t n);

std::int64_t frames_of_first_images(const Block& block, std::int64_t n);

// The generation in which an image was added.
std::size_t generation_of(const std::vector<std::int64_t>& generations, ImageIndex image);

}  // namespace megablock
