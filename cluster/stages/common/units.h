// Names the units of all stages.
#pragma once

#include <cstdint>
#include <string>

namespace megablock {

inline constexpr std::int64_t kShardImages = 64;  // images per unit of feature extraction

std::string unit_name(const std::string& folder, std::int64_t number);  // "features/000003.h5"

}  // namespace megablock
