// Calibration of the rigs of a job's block, on the first rank; the other ranks take part in what comes before it
// (matching of pictures).
#pragma once

#include <string>
#include <vector>

#include "adjust/calibration/rig_observations.h"
#include "cluster/job/job.h"

namespace megablock {

struct CalibrationSettings {
  RigCalibrationOptions rig;
  std::string verification;  // project file of another site; empty: none
  bool json = false;         // figures instead of the table
};

// Collective. `start`: frames with poses where they are known. Writes calibration.yaml (calibration-refused.yaml when
// it is no better than the start) and calibration.html into the job's folder and prints the figures. Throws when the
// calibration is refused, on every rank.
void run_calibration(Job& job, const BlockState& start, const TrackSet& tracks, const CalibrationSettings& settings);

// Poses of frames that have none, from the control points that they see.
void resect_missing(const Block& block, BlockState& state);

}  // namespace megablock
