// Simulates priors, given poses and relative poses with true sigmas, for the scenes without a measured trajectory
// (trajectory.h).
#pragma once

#include <Eigen/Core>

#include "io/simulate/scene/simulated_block.h"
#include "io/simulate/scene/simulation_options.h"

namespace megablock {

// The direction, in axes of the rig, in which antennas are off their lever arms and about which attitudes are turned
// (SimulationOptions::lever_arm_error_m, boresight_error_deg).
inline const Eigen::Vector3d kOffReceiver = Eigen::Vector3d(2, -1, 2) / 3;

void simulate_priors(const SimulationOptions& options, SimulatedBlock& simulated);

}  // namespace megablock
