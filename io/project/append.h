// Adds new images to the block of a job, without changing the indices of the old ones. The units of the job that refer
// to these indices thus remain valid.
//
// The order matters because files of a job name images, frames and cameras by their index, not by their name. Appending
// keeps all of them valid; a sorted merge would not.
#pragma once

#include <functional>

#include "io/block/block.h"

namespace megablock {

// Returns the block of a job that has grown. Cameras, rigs, frames and images of `previous` keep their indices; items
// that only `now` has follow in their order. Items are matched by name, and their contents are those of `now` where it
// has them. Images that only `previous` has remain. The ground frame remains the previous one: positions, attitudes and
// control of `now` are transformed into it if `now` has another origin.
// `after_table` is called after tables of both blocks were read; their memory may then be released.
Block append_to(
    const Block& previous, Block now, const std::function<void()>& after_table = [] {});
// Whether `now` has all images of `previous`, compared by name.
bool has_all_images_of(const Block& previous, const Block& now);

}  // namespace megablock
