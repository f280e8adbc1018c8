// Splits tracks that join two or more ground points, as wrong matches make them. The screening keeps the largest part
// of the observations of a track. This file splits the rest into consistent parts, which become tracks of their own.
//
// A further part has two or more observations of the track. They lie within the screening threshold of their own
// intersection, and meet at an angle of min_intersection_deg or more. Its point must be a different one: most of the
// observations of the earlier parts do not fit it.
#pragma once

#include <cstdint>
#include <vector>

#include "adjust/tile/tile_adjustment.h"
#include "io/block/tracks.h"

namespace megablock {

// The number of the part of every observation of a tie point (rows of the problem without control points). 0 is the
// track's own part; observations that fit nowhere belong to it too.
using TrackParts = std::vector<std::uint8_t>;
TrackParts find_track_parts(const TileProblem& problem, const TileState& state, double threshold_sigmas,
                            const AdjustOptions& options);

// A track for each part. The parts follow the track itself and have its id; observations are in the order of their
// images.
TrackSet split_tracks(const TrackSet& tracks, const TrackParts& parts);

// The rows of `tracks` in the order of split_tracks(tracks, parts).
std::vector<std::int64_t> rows_of_split(const TrackSet& tracks, const TrackParts& parts);

}  // namespace megablock
