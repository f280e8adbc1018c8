// Simulates the street-mapping vehicle Stereopolis V2 (Cannelle 2013): a panoramic head of ten cameras on a mast, and
// stereo pairs.
#pragma once

#include "io/simulate/scene/layout.h"

namespace megablock {

// Adds a rig with options.rig_cameras cameras in this order: 21 22 23 ahead, 31 32 to the sides, 33 34 up the facades,
// 41 42 43 behind; then the stereo pairs 11 12 ahead and 51 52 behind; then 61 62 down to the pavements. Their names
// are "c21", ... The given mounts are the nominal ones, from which the true mounts differ by
// SimulationOptions::mount_*_error; with calibrate = false, mounts are held at the truth. The first mount is exact,
// because it is the reference of the rig. The same seed gives the same vehicle in every scene.
void add_vehicle(const SimulationOptions& options, Layout& layout);

}  // namespace megablock
