// Simulates priors, given poses and relative poses with true sigmas, for the scenes without a measured trajectory
// (trajectory.h).
#pragma once

#include "io/simulate/scene/simulated_block.h"
#include "io/simulate/scene/simulation_options.h"

namespace megablock {

void simulate_priors(const SimulationOptions& options, SimulatedBlock& simulated);

}  // namespace megablock
