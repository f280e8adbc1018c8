// What a vehicle's positioning (GNSS, inertial, odometer) makes of its path, as Cannelle (2013) found it: smooth from
// second to second, metres wrong where satellites are masked, differently on every pass, and with sigmas that lie.
#pragma once

#include "io/simulate/scene.h"

namespace megablock {

// Errors of one pass, frame by frame. With c the memory from frame to frame:
//
//   clear      stationary Gauss-Markov process, e_i = c e_{i-1} + sigma sqrt(1 - c^2) n_i: 2 cm in x and y, 5 cm in z,
//              0.02 deg in roll and pitch, 0.025 deg in heading
//   masked     on top of it, in each stretch of masked frames, the integral of a Gauss-Markov velocity, less its chord
//              (satellites return, and the trajectory was smoothed afterwards), scaled so that its largest horizontal
//              value is drift_m times 2/3 to 4/3, but at most 4 cm per frame of the stretch; in z 0.3 of it; in heading
//              up to 0.06 deg, in roll and pitch half of that
//
// Stretches take exactly gnss_masked_share of the pass; gnss_absent_share lies inside of them.
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
