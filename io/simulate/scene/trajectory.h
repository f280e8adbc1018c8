// What a vehicle's positioning (GNSS, inertial, odometer) makes of its path, as Cannelle (2013) found it: smooth from
// second to second, metres wrong where satellites are masked, differently on every pass, and with sigmas that lie.
#pragma once

#include "io/simulate/scene/scene.h"

namespace megablock {

// Errors of one pass, frame by frame:
//
//   clear      stationary Gauss-Markov process of second order, 2 cm in x and y, 5 cm in z, 0.02 deg in roll and pitch,
//              0.025 deg in heading; it changes over 40 frames, by 1.4 mm from one to the next
//   masked     on top of it, in each stretch of masked frames, a smooth drift that is zero at both ends (satellites
//              return, and the trajectory was smoothed afterwards); its largest horizontal value is drift_m times 2/3
//              to 4/3, but it changes by at most drift_per_frame_m from frame to frame; in z 0.3 of it; in heading up
//              to 0.06 deg, in roll and pitch half of that
//
// Stretches take exactly gnss_masked_share of the pass; gnss_absent_share lies inside of them. Successive frames agree
// to less than 1 cm, as published, which is why a drift of metres takes a stretch of a thousand frames and more.
struct PassErrors {
  std::vector<Gnss> gnss;
  std::vector<Eigen::Vector3d> position;  // metres, east north up
  std::vector<Eigen::Vector3d> rotation;  // radians about the rig's x, y, z
};
PassErrors draw_pass_errors(const SimulationOptions& options, std::int64_t pass, std::int64_t frames);

// Given poses (the trajectory), position and attitude priors with their stated sigmas, and relative poses of successive
// frames, for all passes; fills simulated.gnss.
void simulate_trajectory(const SimulationOptions& options, SimulatedBlock& simulated);

}  // namespace megablock
