// Counts the tracks that all images of a subset have in common (A. Barrier and S. Martin, "Bundle adjustment with known
// positions", report, ENS Paris-Saclay). The numbers of matches of pairs do not tell this: of subsets with like numbers
// for every pair, one may have a tenth of the common tracks of another.
#pragma once

#include <cstdint>
#include <vector>

#include "io/block/tracks.h"

namespace megablock {

struct ImageSubset {
  std::vector<ImageIndex> images;  // ascending
  std::int64_t common_tracks = 0;  // number of tracks with observations in all of these images
};

// Returns the subsets by falling number of common tracks; equal ones keep their order. Images may be in any order, and
// repeated ones count once. Throws InputError for an empty subset.
std::vector<ImageSubset> rank_by_common_tracks(const TrackSet& tracks,
                                               const std::vector<std::vector<ImageIndex>>& subsets);

}  // namespace megablock
