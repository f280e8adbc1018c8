// The page that reports the calibration of a rig.
#pragma once

#include <string>

#include "io/block/block.h"
#include "io/block/calibration.h"

namespace megablock {

// One self-contained page, as the report of a job. `block`: of the calibration.
std::string calibration_html(const RigCalibration& calibration, const Block& block);

}  // namespace megablock
