// Parts of a tile that agree within themselves and stand beside the rest, found again as a whole.
//
// Two passes along one street start metres apart. What one sees of the other's points is then rejected as a gross
// error, each of them fits by itself, and the adjustment ends with the tile in two. To find the frames of a part one by
// one (lost_frames.h) would tear them from their neighbours; the part as a whole is one large rig with known places of
// its cameras, whose pose follows from the points that stand without it.
#pragma once

#include "adjust/problem/tile_problem.h"

namespace megablock {

// Frames hang together where half or more of the tracks that both observe are kept by both, and so do sets of frames
// by the sums over their pairs. Of the sets the largest stands. Another one of three frames or more is lost when fewer
// than thirty, or three tenths, of its observations agree with points that standing frames keep, and nobody else but
// the set itself (residuals up to `threshold_sigmas`). It is moved, with the tie points that it alone keeps, to where
// enough of them agree (RANSAC), and then stands, too; larger sets come first. Observations are not touched: screen
// again afterwards. Returns the frames moved. Deterministic: seeded by a set's lowest global frame.
std::vector<LocalFrame> recover_lost_parts(const TileProblem& problem, TileState& state, double threshold_sigmas);

}  // namespace megablock
