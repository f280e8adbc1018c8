// What a rig calibration found, for people and for programs.
#pragma once

#include <string>

#include "io/block/calibration.h"

namespace megablock {

// Table for the terminal: a line per camera, the comparison with the start, warnings.
std::string calibration_text(const RigCalibration& calibration);

// All figures (keys carry their units; null where unknown).
std::string calibration_json(const RigCalibration& calibration);
}  // namespace megablock
