// Matches two vertical images faster, because everything on the ground is turned by the same angle from one image to
// the other.
//
// Vertical images do not show the vertical (upright_matching.h). But the coarsest features, matched first, tell the
// turn of the pair. Directions of keypoints counted from it are then compared in sectors, which leaves a quarter of the
// comparisons.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "io/block/features.h"

namespace megablock {

// Returns the turn (radians) from directions of keypoints in a to those in b, on which most matches agree to within
// three sectors. Empty where this agreement may be an accident (among pairs without any right match at most one in a
// thousand passes), and where the matches do not agree in size: seen from above, flat ground has the same scale
// everywhere, along streets it has not.
std::optional<double> turn_from_above(const ImageFeatures& a, const ImageFeatures& b,
                                      std::span<const std::pair<std::int32_t, std::int32_t>> matches);

// For each feature the sector of its direction (upright_matching.h), counted from `direction_rad`.
std::vector<std::int8_t> sectors_from(const ImageFeatures& image, double direction_rad);

}  // namespace megablock
