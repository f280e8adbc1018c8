// Corrects the image observations of a tile for rolling shutters (geometry/camera/rolling_shutter.h). Pixels become
// those of cameras that stand still at the poses of their frames.
#pragma once

#include <vector>

#include "adjust/problem/frame_motion.h"
#include "adjust/problem/tile_problem.h"

namespace megablock {

// [frames of the problem] Their motions, from the poses of `at`, which fit each other best. A frame that has no
// neighbour in the problem takes the poses of all from `others`, or stands still where these tell nothing either.
std::vector<Motion> tile_motions(const FramePaths& paths, const TileProblem& problem, const TileState& at,
                                 const BlockState& others);

// [cameras of the problem] Their readout times.
std::vector<Readout> tile_readouts(const Block& block, const TileProblem& problem);

// Corrects every observation in a camera with a readout time; those of tie points keep units of 2^-10 px, in which they
// are stored. The shift is that of the point in `at`, an error of a hundredth of its distance is one of a hundredth of
// the shift. It is not that of the measured row: measurements would then be stretched with their errors, and an
// estimate of the readout time would take the longest one for the best (by 3 ms in a flight with a noise of half a
// pixel). An unknown point has the median distance of the known ones, and the measured row. Observations stay unchanged
// without any known point, and where a camera has no ray for the pixel or no pixel for the point.
void correct_rolling_shutter(const std::vector<Readout>& readouts, const std::vector<Motion>& motions,
                             const TileState& at, TileProblem& problem);

}  // namespace megablock
