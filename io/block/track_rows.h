// Appends rows of one set of tracks to another.
#pragma once

#include <cstdint>
#include <vector>

#include "io/block/tracks.h"

namespace megablock {

// Appends the rows [first, last).
template <typename Value>
void append_rows(const std::vector<Value>& from, std::int64_t first, std::int64_t last, std::vector<Value>& to) {
  to.insert(to.end(), from.begin() + static_cast<std::ptrdiff_t>(first),
            from.begin() + static_cast<std::ptrdiff_t>(last));
}

// Appends the tracks [first, last) with their observations. `to` may be empty, even without its first `begin`.
void append_tracks(const TrackSet& from, std::int64_t first, std::int64_t last, TrackSet& to);

}  // namespace megablock
