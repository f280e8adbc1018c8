// Places where passes are registered and what came of it: what partition/ chooses, adjust/ computes and the files hold.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "geometry/transform/pose.h"
#include "io/base/index.h"

namespace megablock {

// Two successive frames of each of two passes.
struct Place {
  FrameIndex a, b, c, d;
  std::int32_t component = 0;  // of the panorama graph
};

struct PairRegistration {
  bool accepted = false;
  std::string reason;  // why not
  Pose relative;       // A -> C (RelativePose::pose)
  // Of Log(R R_estimated') [rad] and of the centre of C in the axes of A [m].
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  std::int32_t tracks = 0, measurements = 0, kept = 0;  // tracks: in enough frames; kept: measurements
  double median_before_px = 0, median_after_px = 0;     // residual lengths with the trajectory's pose; of kept ones
  double position_sigma_m = 0, rotation_sigma_deg = 0;  // lengths
  double shift_m = 0;                                   // from the trajectory's relative pose
};

struct RegisteredPlace {
  Place place;
  PairRegistration registration;
};

// What the joint adjustment leaves.
struct RegisteredTrajectory {
  std::vector<Pose> frames;                  // [frames]
  std::vector<double> position_weight;       // [frames] 0..1, of the trajectory's position; 0: none
  std::vector<double> weight, residual;      // [places] weight 0..1, length of the normalised residual; 0: not used
  std::vector<std::int64_t> control_points;  // rows of Block::control_points that took part
  std::vector<Eigen::Vector3d> points;       // [control_points] adjusted positions, metres
  std::int64_t resections = 0;               // frames
  std::vector<std::string> not_resected;     // why, of each other frame that sees control
};

}  // namespace megablock
