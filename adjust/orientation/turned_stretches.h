// Turns back the stretches of a pass that the adjustments of the tiles left turned against their relative poses.
//
// A stretch that reaches into a tile from its neighbour is held there by tie points alone, because the relative poses
// at its ends belong to the neighbour. If poor start values cost it its ties to other passes, it may end turned by tens
// of degrees about the line of its positions. It then still agrees with itself and with its GNSS positions, and no
// iteration of the global adjustment can bring it back. The relative poses at its ends show the error: it is many of
// their sigmas and too large for a linearisation.
//
// Relative poses that the present poses fulfil join frames to groups. If a group is tied to a larger one by
// contradicted relative poses only, it is moved as a whole so that one of them is fulfilled. This happens only if the
// group has observed positions, stays at them, and at least halves its median angle to the initial orientation. So a
// wrong relative pose moves nothing, unless the initial orientation was made from it and it is wrong about the line of
// the positions only.
#pragma once

#include <cstdint>

#include "io/block/block.h"

namespace megablock {

struct StretchOptions {
  double max_rotation_rad = 0.0175;  // a relative pose is contradicted from 1 degree on
  double max_sigmas = 20;            // and from this many of its sigmas on
};

// Moves the turned stretches of the oriented frames of `state` and returns the number of frames moved. `initial` is the
// orientation before any adjustment.
std::int64_t turn_back_stretches(const Block& block, const BlockState& initial, BlockState& state,
                                 const StretchOptions& options = {});

}  // namespace megablock
