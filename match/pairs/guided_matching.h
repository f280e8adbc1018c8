// Matches two images whose relative orientation is trusted. A feature is compared only with features near its epipolar
// line, between the smallest and the largest object distance. The ratio test then sees only rivals that the geometry
// allows: the next window of a repeated facade no longer makes the right match ambiguous.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "match/pairs/pair_matching.h"
#include "match/verification/trusted_pair.h"

namespace megablock {

struct GuidedMatches {
  std::vector<std::pair<std::int32_t, std::int32_t>> matches;  // (row in a, row in b), ascending
  double half_width_px = 0;   // half width of the band, median over the features of a, pixels
  std::int64_t compared = 0;  // number of descriptor comparisons
};

// Returns the k-best mutual matches within the band of three sigmas (TrustedPair::epipolar_sigma_px). Where the
// geometry leaves fewer than k + 1 candidates, a descriptor at an angle of 41 degrees takes the place of the next one
// in the ratio test.
GuidedMatches match_along_epipolar(const ImageFeatures& a, const ImageFeatures& b, const Camera& camera_a,
                                   const Camera& camera_b, const TrustedPair& pair, const MatchOptions& options);

}  // namespace megablock
