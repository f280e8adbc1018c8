// Matching of two images that look down: what lies on the ground is turned by the same angle wherever it is seen.
//
// From above no vertical is seen (upright_matching.h). But the coarsest features of both images, matched first, tell
// the turn of the pair, and directions counted from it are compared in the same sectors: a quarter of all comparisons.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "io/block/features.h"

namespace megablock {

// From directions of keypoints in a to those in b, radians, as most matches have it within three sectors. None where
// they might agree by accident (of pairs without any right match no more than one in a thousand has a turn), and where
// they do not agree in size: from above flat ground is as large in one place as in another, along streets it is not.
std::optional<double> turn_from_above(const ImageFeatures& a, const ImageFeatures& b,
                                      std::span<const std::pair<std::int32_t, std::int32_t>> matches);

// [features]: sectors (upright_matching.h) of their directions, counted from this one.
std::vector<std::int8_t> sectors_from(const ImageFeatures& image, double direction_rad);

}  // namespace megablock
