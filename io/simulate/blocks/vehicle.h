// The street-mapping vehicle Stereopolis V2 (Cannelle 2013): a panoramic head of ten cameras on a mast and stereo
// pairs.
#pragma once

#include "io/simulate/scene/scene.h"

namespace megablock {

// Adds the rig of options.rig_cameras cameras: ids 21 22 23 ahead, 31 32 to the sides, 33 34 up the facades, 41 42 43
// behind; then the stereo pairs 11 12 ahead and 51 52 behind, then 61 62 down the pavements. Names "c21" ...
// The given mounts are the nominal ones, the true ones are off by SimulationOptions::mount_*_error (calibrate: false:
// held at the truth); the first is exact, being the rig's reference. The same seed makes the same vehicle in every
// scene.
void add_vehicle(const SimulationOptions& options, Layout& layout);

}  // namespace megablock
