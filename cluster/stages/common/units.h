// What the units of all stages have in common: the algorithm numbers in their fingerprints, and their names.
#pragma once

#include <cstdint>
#include <string>

namespace megablock {

// Algorithm number of each stage: part of its fingerprints, raised when its results change.
namespace algorithm {
inline constexpr int kFeatures = 1, kCandidates = 1, kMatching = 12, kTiles = 3, kTracks = 3, kOrientation = 9,
                     kAdjustment = 17, kMerge = 19, kResult = 1;
}

inline constexpr std::int64_t kShardImages = 64;  // images per unit of feature extraction

std::string unit_name(const std::string& folder, std::int64_t number);  // "features/000003.h5"

}  // namespace megablock
