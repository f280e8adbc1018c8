// Shows the reliability of an adjustment without ground truth, by adjusting the same frames with disjoint subsets of
// the points (Barrier and Martin).
//
// Each subset is adjusted by itself, with the priors and control points that all subsets share. One reference point is
// in all subsets. The spread of the results shows the noise of the observations, which the subsets do not share. It
// does not show errors that they share: where only attitude priors determine a common rotation, subsets agree to a
// tenth of their error. The sigma of this rotation (common_motion.h) is therefore given beside the spread.
#pragma once

#include "adjust/checks/common_motion.h"
#include "adjust/tile/tile_adjustment.h"

namespace megablock {

struct SubsetCheck {
  int subsets = 0;
  double rotation_spread_rad = 0;  // rms per axis about the mean of the subsets, over frames
  double rotation_move_rad = 0;    // rms per axis of the movement of that mean from the start
  double image_spread_px = 0;      // rms per axis of the reference point's adjusted image positions
  double common_sigma_rad = 0;     // sigma of the error that all subsets share, so that none shows it; 0: there is none
  // The sigma of the mean of the subsets, per axis.
  double rotation_sigma_rad() const;
};
// Every subset starts from `state`. `reference` is a tie point that is in all subsets; other tie points go to the
// subsets in turn. Throws InputError for fewer than two subsets or for a reference that takes no part, and ComputeError
// when a subset cannot be adjusted.
SubsetCheck check_point_subsets(const TileProblem& problem, const TileState& state, std::int64_t reference, int subsets,
                                const MotionReference& motion, const TileSolver& solver);

}  // namespace megablock
