// Holds the places where passes are registered with each other, and the results of these registrations. partition/
// chooses the places, and adjust/ registers the passes.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "geometry/transform/pose.h"
#include "io/base/index.h"

namespace megablock {

// Two successive frames (a, b) of one pass and two (c, d) of another, at the same place.
struct Place {
  FrameIndex a, b, c, d;
  std::int32_t component = 0;  // of the panorama graph
};

// The registration of two passes at one place.
struct PairRegistration {
  bool accepted = false;
  std::string reason;  // the reason if it was not accepted
  Pose relative;       // A -> C (RelativePose::pose)
  // Covariance of Log(R R_estimated') (radians) and of the centre of C in the axes of A (metres).
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  std::int32_t tracks = 0, measurements = 0, kept = 0;  // tracks: in enough frames; kept: observations
  // Lengths of residuals with the trajectory's pose, and of the kept ones.
  double median_before_px = 0, median_after_px = 0;
  double position_sigma_m = 0, rotation_sigma_deg = 0;  // lengths
  double shift_m = 0;                                   // distance from the trajectory's relative pose
};

struct RegisteredPlace {
  Place place;
  PairRegistration registration;
};

// The result of the joint adjustment.
struct RegisteredTrajectory {
  std::vector<Pose> frames;              // [frames]
  std::vector<double> position_weight;   // [frames] 0 to 1, weight of the trajectory's position; 0: none
  std::vector<double> weight, residual;  // [places] weight 0 to 1, and length of the normalised residual; 0: not used
  std::vector<std::int64_t> control_points;  // rows of Block::control_points that took part
  std::vector<Eigen::Vector3d> points;       // [control_points] adjusted positions, metres
  std::int64_t resections = 0;               // number of frames
  std::vector<std::string> not_resected;     // the reason, for each other frame that sees control
};

}  // namespace megablock
