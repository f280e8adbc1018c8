// Finds parts of a tile that are consistent in themselves but do not fit the rest, and moves them as a whole.
//
// Two passes along one street start metres apart. The observations of one pass of the points of the other are then
// rejected as gross errors, each pass fits by itself, and the adjustment ends with the tile in two. To find the frames
// of a part one by one (lost_frames.h) would tear them from their neighbours. The part as a whole is one large rig with
// known positions of its cameras, and its pose follows from the points of the other frames.
#pragma once

#include "adjust/problem/tile_problem.h"

namespace megablock {

// Two frames are connected when both keep half or more of the tracks that both observe. Sets of frames are connected by
// the sums over their pairs of frames. The largest set stands. Another set of three frames or more is lost when too few
// of its observations agree with points that only standing frames, two or more, and perhaps the set itself keep: fewer
// than thirty, or than three tenths (residuals up to `threshold_sigmas`). It is moved, with the tie points that it
// alone keeps, to where enough of its observations agree (RANSAC), and then stands too. Larger sets come first.
// Observations stay as they are: screen them again afterwards. Returns the frames that were moved. Deterministic: the
// seed is the index of the lowest frame of a set.
std::vector<LocalFrame> recover_lost_parts(const TileProblem& problem, TileState& state, double threshold_sigmas);

}  // namespace megablock
