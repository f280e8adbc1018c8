// Tracks = connected components of the matches; a component that sees an image twice is split into consistent parts.
#pragma once

#include <vector>

#include "io/features.h"
#include "io/tracks.h"

namespace megablock {

struct TrackOptions {
  int min_length = 2;  // images
};

// Features indexed by image (rows of the result refer to them). Independent of the order of `pairs`. Track ids are
// 0..n-1, ordered by first image, then first feature.
TrackSet build_tracks(const IndexedVector<ImageIndex, std::vector<Keypoint>>& keypoints,
                      const std::vector<VerifiedPair>& pairs, const TrackOptions& options);

}  // namespace megablock
