// Chooses a connected sample of a block that is small enough to be adjusted many times.
#pragma once

#include "io/block/block.h"
#include "io/block/tracks.h"

namespace megablock {

struct BlockSampleOptions {
  std::int64_t max_frames = 60;           // frames
  std::int64_t max_observations = 60000;  // of tie points; with more, only every second, third ... track is taken
  void check() const;                     // throws InputError
};

struct BlockSample {
  BlockState state;  // frames outside of the sample are not oriented
  TrackSet tracks;   // their observations in the sample, in two or more frames each
  std::int64_t frames = 0, images = 0;
};

// Grows the sample from the oriented frame with most observations. Each further frame is the one that shares most
// tracks with the sample (of equal ones, that with the lower index). Throws InputError when no two oriented frames
// share tracks.
BlockSample sample_block(const Block& block, const BlockState& state, const TrackSet& tracks,
                         const BlockSampleOptions& options);

}  // namespace megablock
