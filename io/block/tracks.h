// Holds tracks (tie points) and their observations, as compressed sparse rows.
//
// Positions are integers in units of 2^-10 px, which a double represents exactly. Files and all calculations use the
// same values. Rounding moves a coordinate by at most 2^-11 px = 0.0005 px; the range is +-2^21 px.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "io/base/index.h"

namespace megablock {

inline constexpr double kPixelUnit = 1.0 / 1024;  // px

inline std::int32_t to_fixed_pixel(double px) { return static_cast<std::int32_t>(std::lround(px * 1024)); }
inline double from_fixed_pixel(std::int32_t v) { return v * kPixelUnit; }

// The observations of track t are the rows [begin[t], begin[t+1]). The images of a track are ascending and distinct.
struct TrackSet {
  std::vector<TrackIndex> id;         // [tracks] ascending global indices
  std::vector<std::int64_t> begin;    // [tracks + 1]
  std::vector<ImageIndex> image;      // [observations]
  std::vector<std::int32_t> x, y;     // [observations], 2^-10 px, pixel centres at +0.5
  std::vector<std::int32_t> feature;  // [observations] row in the features of the image; -1: none

  std::int64_t track_count() const { return static_cast<std::int64_t>(id.size()); }
  std::int64_t observation_count() const { return static_cast<std::int64_t>(image.size()); }
};

}  // namespace megablock
