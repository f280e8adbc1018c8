// Simulates the measured relative pose of two frames.
#pragma once

#include "io/simulate/scene/random.h"
#include "io/simulate/scene/simulated_block.h"
#include "io/simulate/scene/simulation_options.h"

namespace megablock {

// With the sigmas and the noise of the options, which are the true ones.
RelativePose measure_relative(const SimulationOptions& options, const BlockState& truth, FrameIndex from, FrameIndex to,
                              Random& random);

}  // namespace megablock
