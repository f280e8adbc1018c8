// Corrects the measurements of a tile with rolling shutters before its adjustment.
#pragma once

#include "adjust/problem/rolling_shutter_correction.h"
#include "adjust/tile/tile_adjustment.h"

namespace megablock {

struct RollingShutters {
  const FramePaths& paths;
  std::vector<Readout> readouts;  // [cameras of the problem]
  const BlockState& others;       // of frames outside of the problem (tile_motions)
};

// Corrects the measurements of the problem with the poses and points of `at`. Points that it does not know are
// intersected from the measurements as they are, and then again from the corrected ones, and stand in `at` afterwards.
// The set of kept observations does not change.
void correct_rolling_start(const RollingShutters& shutters, const AdjustOptions& options, TileProblem& problem,
                           TileState& at);

// adjust_tile() of a problem with measurements as they are. It adjusts twice: the poses of the first solution tell the
// motion better than the start. The measurements of the problem are the corrected ones afterwards.
AdjustSummary adjust_moving_tile(const RollingShutters& shutters, TileProblem& problem, TileState& state,
                                 const AdjustOptions& options, const TileSolver& solver);

}  // namespace megablock
