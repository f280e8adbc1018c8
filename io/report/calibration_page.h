// Writes the report of a rig calibration as an HTML page.
#pragma once

#include <string>

#include "io/block/block.h"
#include "io/block/calibration.h"

namespace megablock {

// Returns one self-contained page, as for the report of a job. `block` is the block of the calibration.
std::string calibration_html(const RigCalibration& calibration, const Block& block);

}  // namespace megablock
