// Converts between degrees and radians.
//
// All angles inside the program are in radians. Files, options and messages give them in degrees, and convert with
// these two factors where they are read or written.
#pragma once

#include <numbers>

namespace megablock {

inline constexpr double kDegree = std::numbers::pi / 180;            // one degree in radians
inline constexpr double kDegreesPerRadian = 180 / std::numbers::pi;  // one radian in degrees

}  // namespace megablock
