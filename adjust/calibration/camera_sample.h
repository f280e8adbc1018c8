// Takes a sample of the frames of one rig and of the tie points that they share, for the choice of the parameters of
// its cameras. Unlike block_sample.h it needs no track of the rest of the block, so it suits blocks of any size, and it
// does not depend on the division into tiles.
#pragma once

#include <vector>

#include "io/block/block.h"
#include "io/result/measurements.h"

namespace megablock {

struct CameraSampleOptions {
  std::int64_t max_frames = 60;
  std::int64_t max_observations = 30000;  // of tie points; with more, only every second, third ... track is taken
};

// The oriented frames of the rig in `component` that are nearest to its middle, the medians of their coordinates.
// Equally far ones: those with the lower index. Ascending.
std::vector<FrameIndex> frames_near_the_middle(const Block& block, const BlockState& state, RigIndex rig,
                                               const IndexedVector<FrameIndex, std::int32_t>& component,
                                               std::int64_t max_frames);

// The tracks that two or more of the frames share, of the observations in their images. They are in the order of their
// first observations in the sample, whatever tile owns them.
TrackSet tracks_in_frames(const Block& block, const Measurements& observations, std::int64_t max_observations);

}  // namespace megablock
