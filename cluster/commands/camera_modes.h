// Adds the modes of `calibrate` for single cameras: --panoramic and --compare-models.
#pragma once

#include "cluster/commands/calibrate_command.h"

namespace megablock {

// --panoramic: a camera that was rotated about its projection centre (adjust/calibration/panoramic.h).
CalibrateMode add_panoramic(CLI::App& command);
// --compare-models: camera models on the same observations (adjust/calibration/model_comparison.h).
CalibrateMode add_compare_models(CLI::App& command);

}  // namespace megablock
