// Matching of two images whose relative orientation is trusted: a feature is compared with those near its epipolar line
// only, between a least and a largest distance. The ratio test then sees the rivals that geometry leaves, so that the
// next window of a repeated facade takes nothing from the right match.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "match/pairs/pair_matching.h"
#include "match/verification/trusted_pair.h"

namespace megablock {

struct GuidedMatches {
  std::vector<std::pair<std::int32_t, std::int32_t>> matches;  // (row in a, row in b), ascending
  double half_width_px = 0;                                    // of the band, median over the features of a
  std::int64_t compared = 0;                                   // descriptors
};

// k-best mutual matches within the band of three sigmas (TrustedPair::epipolar_sigma_px). Where geometry leaves fewer
// than k + 1 rivals, a descriptor at an angle of 41 degrees stands for the next one.
GuidedMatches match_along_epipolar(const ImageFeatures& a, const ImageFeatures& b, const Camera& camera_a,
                                   const Camera& camera_b, const TrustedPair& pair, const MatchOptions& options);

}  // namespace megablock
