// Calibrates the rigs of a block on the first rank. The other ranks take part in the stages before it, such as
// matching.
#pragma once

#include <string>
#include <vector>

#include "adjust/calibration/rig_observations.h"
#include "cluster/job/job.h"

namespace megablock {

struct CalibrationSettings {
  RigCalibrationOptions rig;
  std::string verification;  // project file of another site; empty: none
  bool json = false;         // prints figures instead of the table
};

// Collective. `notes`: warnings of the job. `start`: the frames, with poses where they are known. Writes
// calibration.yaml (calibration-refused.yaml when the result is no better than the start) and calibration.html into the
// job folder, and prints the figures. Throws on every rank when the calibration is refused.
void run_calibration(const Job& job, const std::vector<std::string>& notes, const BlockState& start,
                     const TrackSet& tracks, const CalibrationSettings& settings);

// Finds poses of frames without one from the control points that they see.
void resect_missing(const Block& block, BlockState& state);

}  // namespace megablock
