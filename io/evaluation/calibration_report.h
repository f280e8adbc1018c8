// Writes the result of a rig calibration as a table for people and as JSON for programs.
#pragma once

#include <string>

#include "io/block/calibration.h"

namespace megablock {

// A table for the terminal: one line per camera, the comparison with the rig at the start, and warnings.
std::string calibration_text(const RigCalibration& calibration);

// All figures. The keys contain the units; unknown figures are null.
std::string calibration_json(const RigCalibration& calibration);
}  // namespace megablock
