// How many tracks all images of a subset have in common (KP-12). Matches of pairs do not tell: of subsets with like
// numbers for every pair, one may share a tenth of the tracks of another.
#pragma once

#include <cstdint>
#include <vector>

#include "io/block/tracks.h"

namespace megablock {

struct ImageSubset {
  std::vector<ImageIndex> images;  // ascending
  std::int64_t common_tracks = 0;  // seen in every one of them
};

// The subsets (images in any order, repeated ones count once) by falling number of common tracks; equal ones as given.
// InputError for a subset without images.
std::vector<ImageSubset> rank_by_common_tracks(const TrackSet& tracks,
                                               const std::vector<std::vector<ImageIndex>>& subsets);

}  // namespace megablock
