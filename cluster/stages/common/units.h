// Names and algorithm numbers of the units of all stages.
#pragma once

#include <cstdint>
#include <string>

namespace megablock {

// The algorithm number of each stage is part of its fingerprints. Raise it when the results of the stage change.
namespace algorithm {
inline constexpr int kFeatures = 1, kCandidates = 1, kMatching = 12, kTiles = 3, kTracks = 3, kOrientation = 9,
                     kAdjustment = 17, kMerge = 19, kResult = 1;
}

inline constexpr std::int64_t kShardImages = 64;  // images per unit of feature extraction

std::string unit_name(const std::string& folder, std::int64_t number);  // "features/000003.h5"

}  // namespace megablock
