// Rows of one set of tracks added to another.
#pragma once

#include <cstdint>
#include <vector>

#include "io/block/tracks.h"

namespace megablock {

// Rows [first, last) behind the others.
template <typename Value>
void append_rows(const std::vector<Value>& from, std::int64_t first, std::int64_t last, std::vector<Value>& to) {
  to.insert(to.end(), from.begin() + static_cast<std::ptrdiff_t>(first),
            from.begin() + static_cast<std::ptrdiff_t>(last));
}

// Tracks [first, last) with their observations behind those of `to`, which may be a set without even its first begin.
void append_tracks(const TrackSet& from, std::int64_t first, std::int64_t last, TrackSet& to);

}  // namespace megablock
