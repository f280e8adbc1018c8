// Frames whose start pose is plainly wrong, found again from the points that the other frames intersect.
#pragma once

#include "adjust/problem/tile_problem.h"

namespace megablock {

// A frame is lost when fewer than three tenths of its observations agree with points that are kept by two or more other
// frames. Its pose is computed anew by three-point resection (RANSAC; residuals up to `threshold_sigmas` agree), and
// taken when at least twelve observations and three tenths of them agree. Observations are not touched: screen again
// afterwards. Returns the frames with a new pose. Deterministic: seeded by the frame's global index.
std::vector<LocalFrame> recover_lost_frames(const TileProblem& problem, TileState& state, double threshold_sigmas);

}  // namespace megablock
