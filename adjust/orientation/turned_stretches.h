// Stretches of a pass that contradict the relative poses by which they hang on the rest of the block.
//
// A tile's own adjustment holds a stretch that reaches in from a neighbouring tile by tie points alone: the relative
// poses at its ends belong to the neighbour. Where its ties to other passes were lost among poor start values, it may
// end turned about the line of its positions, by tens of degrees, in agreement with itself and with its GNSS positions;
// no step of the global adjustment finds back from there. The relative poses at its ends say so: by many of their
// sigmas and by more than what linearisation bears.
//
// Frames are joined by the relative poses that their orientations fulfil. A group that only contradicted ones tie to a
// larger one is moved as a whole so that it fulfils one of these, if that brings it nearer to the rotations of the
// initial orientation and keeps it at its observed positions; a group without any stays. So a wrong relative pose moves
// nothing, unless the initial orientation was made from it and it is wrong about the line of the positions only.
#pragma once

#include <cstdint>

#include "io/block/block.h"

namespace megablock {

struct StretchOptions {
  double max_rotation_rad = 0.0175;  // 1 degree: contradiction of a relative pose that is looked at
  double max_sigmas = 20;            // and this many of its sigmas
};

// Moves the stretches of `state` (frames that are oriented); how many frames were moved. `initial`: the orientation
// before any adjustment.
std::int64_t turn_back_stretches(const Block& block, const BlockState& initial, BlockState& state,
                                 const StretchOptions& options = {});

}  // namespace megablock
