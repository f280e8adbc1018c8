// The modes of `calibrate` for single cameras: --panoramic and --compare-models.
#pragma once

#include "cluster/commands/calibrate_command.h"

namespace megablock {

// Camera turned about its centre (adjust/calibration/panoramic.h).
CalibrateMode add_panoramic(CLI::App& command);
// Camera models on the same measurements (adjust/calibration/model_comparison.h).
CalibrateMode add_compare_models(CLI::App& command);

}  // namespace megablock
