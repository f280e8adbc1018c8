// Radians everywhere inside; degrees in files, options and messages.
#pragma once

#include <numbers>

namespace megablock {

inline constexpr double kDegree = std::numbers::pi / 180;  // in radians
inline constexpr double kDegreesPerRadian = 180 / std::numbers::pi;

}  // namespace megablock
