// Gives the trajectory of a block as input of the joint adjustment: start poses, passes, the chain of successive
// frames, and the control points observed along the path.
#pragma once

#include <string>
#include <vector>

#include "adjust/registration/joint_adjustment.h"

namespace megablock {

struct TrajectoryOptions {
  // Sigmas of the chain, the same for all links, because stated sigmas are often too small (successive frames of a
  // vehicle agree to better than a centimetre, Cannelle 2013); 0: those of the relative poses.
  double chain_position_sigma_m = 0.005, chain_rotation_sigma_deg = 0.01;
  // Sigmas of links that are made of differences of the trajectory, where the block has no relative pose.
  double difference_position_sigma_m = 0.02, difference_rotation_sigma_deg = 0.02;
  double max_gap_m = 50, max_gap_s = 60;  // successive frames farther apart get no such link
  enum class CheckPoints { kIgnore, kTie } check_points = CheckPoints::kTie;  // both are variants of Cannelle 2013
  bool use_control = true;
  std::string check_prefix;  // control points whose names begin with this are check points too
  void check() const;        // throws InputError
};

struct Trajectory {
  JointInput input;                     // start, passes, located, chain, points
  std::vector<std::int64_t> point_row;  // [input.points] of Block::control_points
  std::vector<std::string> notes;       // gaps, copies; one line each
};

// Gives start poses: the given ones, else position and attitude priors, else the pose of the frame before, continued by
// a relative pose. A pass may be listed against its times. Throws InputError naming the frame when it has no pose, when
// its pose is not finite, or when the times of its pass neither ascend nor descend throughout.
Trajectory trajectory_of(const Block& block, const TrajectoryOptions& options);

}  // namespace megablock
