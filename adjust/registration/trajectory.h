// Gives the trajectory of a block as input of the joint adjustment: start poses, passes, the chain of successive
// frames, and the control points observed along the path.
#pragma once

#include <string>
#include <vector>

#include "adjust/registration/joint_adjustment.h"

namespace megablock {

struct TrajectoryOptions {
  // Sigmas of the chain, the same for all links, because stated ones lie; 0: as stated by the relative poses.
  double chain_position_sigma_m = 0.005, chain_rotation_sigma_deg = 0.01;
  // Of links made of the trajectory's own differences, where the block has no relative pose.
  double difference_position_sigma_m = 0.02, difference_rotation_sigma_deg = 0.02;
  double max_gap_m = 50, max_gap_s = 60;  // successive frames farther apart are not linked by such differences
  enum class CheckPoints { kIgnore, kTie } check_points = CheckPoints::kTie;  // both variants of Cannelle 2013
  bool use_control = true;
  std::string check_prefix;  // control points whose names begin so are check points too
  void check() const;        // throws InputError
};

struct Trajectory {
  JointInput input;                     // start, passes, located, chain, points
  std::vector<std::int64_t> point_row;  // [input.points] of Block::control_points
  std::vector<std::string> notes;       // gaps, copies; one line each
};

// Start poses: the given ones, else position and attitude priors, else the frame before carried on by a relative pose.
// A pass may be listed against its times. Throws InputError naming the frame: no pose, not finite, times of a pass that
// neither ascend nor descend throughout.
Trajectory trajectory_of(const Block& block, const TrajectoryOptions& options);

}  // namespace megablock
