// Tracks (tie points) and their observations, compressed sparse rows.
//
// Positions are integers in units of 2^-10 px (exact in double), as stored; every consumer reads these values.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "io/base/index.h"

namespace megablock {

inline constexpr double kPixelUnit = 1.0 / 1024;  // px

inline std::int32_t to_fixed_pixel(double px) { return static_cast<std::int32_t>(std::lround(px * 1024)); }
inline double from_fixed_pixel(std::int32_t v) { return v * kPixelUnit; }

// Observations of track t are rows [begin[t], begin[t+1]); images ascending and distinct inside a track.
struct TrackSet {
  std::vector<TrackIndex> id;         // [tracks], ascending global indices
  std::vector<std::int64_t> begin;    // [tracks + 1]
  std::vector<ImageIndex> image;      // [observations]
  std::vector<std::int32_t> x, y;     // [observations], 2^-10 px, pixel centres at +0.5
  std::vector<std::int32_t> feature;  // [observations], row in the image's features; -1 when there is none

  std::int64_t track_count() const { return static_cast<std::int64_t>(id.size()); }
  std::int64_t observation_count() const { return static_cast<std::int64_t>(image.size()); }
};

}  // namespace megablock
