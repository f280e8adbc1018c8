// Chooses the tracks with which a dense tile is brought near its solution.
#pragma once

#include "adjust/problem/tile_problem.h"

namespace megablock {

// Tracks that each frame should have, spread over its images, at least so many of each image, and tracks that each two
// linked frames should have in common.
inline constexpr std::int64_t kTracksOfFrame = 200, kTracksOfImage = 20, kTracksOfPair = 20;

// Keeps the observations of enough tracks, the longest first, and of all control points, and rejects the others. Weak
// links need tracks of their own: a part of the tile that hangs together with the rest by few tracks would lose its
// size and place without them, and then these tracks in the screening. Returns false, and changes nothing, for a tile
// that is not dense: it would keep more than half of its observations anyway.
bool choose_long_tracks(TileProblem& problem);

}  // namespace megablock
