// Finds frames whose start pose is far off, and resects them from the points that the other frames intersect.
#pragma once

#include "adjust/problem/tile_problem.h"

namespace megablock {

// A frame is lost when fewer than three tenths of its observations agree with points that two or more other frames
// keep. Its pose is computed anew by three-point resection (RANSAC; residuals up to `threshold_sigmas` are inliers). It
// is taken when at least twelve observations, and three tenths of them, are inliers. Observations stay as they are:
// screen them again afterwards. Returns the frames with a new pose. Deterministic: the seed is the frame's index in the
// block.
std::vector<LocalFrame> recover_lost_frames(const TileProblem& problem, TileState& state, double threshold_sigmas);

}  // namespace megablock
