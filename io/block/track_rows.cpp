#include "io/block/track_rows.h"

namespace megablock {

void append_tracks(const TrackSet& from, std::int64_t first, std::int64_t last, TrackSet& to) {
  if (to.begin.empty()) to.begin.push_back(0);
  const std::int64_t row = from.begin[static_cast<std::size_t>(first)];
  const std::int64_t end = from.begin[static_cast<std::size_t>(last)];
  // The offsets of `from` are moved to the rows in `to`.
  const std::int64_t shift = to.observation_count() - row;
  append_rows(from.id, first, last, to.id);
  for (std::int64_t t = first + 1; t <= last; ++t) to.begin.push_back(from.begin[static_cast<std::size_t>(t)] + shift);
  append_rows(from.image, row, end, to.image);
  append_rows(from.x, row, end, to.x);
  append_rows(from.y, row, end, to.y);
  append_rows(from.feature, row, end, to.feature);
}

}  // namespace megablock
