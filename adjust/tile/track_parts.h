// Tracks that join two or more ground points, as wrong matches make them: the screening keeps the largest part of the
// observations; here the rest is split into consistent parts, which become tracks of their own.
//
// A further part has two or more observations of the track, within the screening threshold of their own intersection,
// meeting at no less than min_intersection_deg; and its point is another one: most of the observations of the parts
// before do not pass at it.
#pragma once

#include <cstdint>
#include <vector>

#include "adjust/tile/tile_adjustment.h"
#include "io/block/tracks.h"

namespace megablock {

// Number of the part of every observation of a tie point (rows of the problem, control points left out); 0 = the
// track's own, to which observations that fit nowhere belong.
using TrackParts = std::vector<std::uint8_t>;
TrackParts find_track_parts(const TileProblem& problem, const TileState& state, double threshold_sigmas,
                            const AdjustOptions& options);

// A track per part, with the id of the whole one and behind it; observations in the order of their images.
TrackSet split_tracks(const TrackSet& tracks, const TrackParts& parts);

// Rows of `tracks` in the order of split_tracks(tracks, parts).
std::vector<std::int64_t> rows_of_split(const TrackSet& tracks, const TrackParts& parts);

}  // namespace megablock
