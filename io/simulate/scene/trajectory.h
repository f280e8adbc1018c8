// Simulates the measured trajectory of a vehicle (GNSS, inertial unit, odometer) with the errors that Cannelle (2013)
// found. It is smooth from second to second, but wrong by metres where satellites are masked, by other amounts on every
// pass, and its stated sigmas are too small.
// Internal to io/: it is not installed.
#pragma once

#include "io/simulate/scene/simulated_block.h"
#include "io/simulate/scene/simulation_options.h"

namespace megablock {

// The errors of one pass, frame by frame:
//
//   clear      A stationary Gauss-Markov process of second order: 2 cm in x and y, 5 cm in z, 0.02 deg in roll and
//              pitch, 0.025 deg in heading. It has a correlation length of 40 frames and changes by 1.4 mm per frame.
//   masked     In each stretch of masked frames, a smooth drift is added. It is zero at both ends, because satellites
//              return and the trajectory is smoothed afterwards. Its largest horizontal value is drift_m times 2/3 to
//              4/3, but it changes by at most drift_per_frame_m per frame. The drift in z is 0.3 of it; that in heading
//              is up to 0.06 deg, and in roll and pitch half of that.
//
// The stretches have exactly gnss_masked_share of the pass; gnss_absent_share is inside them. Successive frames agree
// to less than 1 cm, as published. Therefore a drift of metres needs a stretch of a thousand frames or more.
struct PassErrors {
  std::vector<Gnss> gnss;
  std::vector<Eigen::Vector3d> position;  // metres; east, north, up
  std::vector<Eigen::Vector3d> rotation;  // radians about the rig's x, y, z
};
PassErrors draw_pass_errors(const SimulationOptions& options, std::int64_t pass, std::int64_t frames);

// Sets, for all passes, the given poses (the trajectory), the position and attitude priors with their stated sigmas,
// the relative poses of successive frames, and simulated.gnss.
void simulate_trajectory(const SimulationOptions& options, SimulatedBlock& simulated);

}  // namespace megablock
