// A block that has grown: the images of a job that runs and those that were added since.
#pragma once

#include <functional>

#include "io/block/block.h"

namespace megablock {

// The block of a job that has grown: cameras, rigs, frames and images of `previous` keep their indices (matched by
// name), those only in `now` follow in their order; contents are those of `now` where it has the item. Images of
// `previous` that are gone stay. The ground frame stays the previous one: positions, attitudes and control of `now` are
// turned into it when it has another origin.
// `after_table` is called behind a table of both that was gone through: it may leave memory.
Block append_to(
    const Block& previous, Block now, const std::function<void()>& after_table = [] {});
// By name.
bool has_all_images_of(const Block& previous, const Block& now);

}  // namespace megablock
