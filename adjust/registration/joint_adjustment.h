// Adjusts the poses of all frames of a trajectory together (Cannelle 2013: chain, registrations, resections and
// control). The observations are
//
//   chain          successive frames of a pass: in the axes of the first frame, as a 2x2 registration, or as
//                  published, in ground axes: S_i - S_{i-1} = dS, R_i R_{i-1}' = dR
//   registrations  relative poses of crossing passes with their covariances; their weights can be switched off
//   resections     absolute poses of frames with their covariances
//   positions      of the trajectory, whose stated sigmas are not trusted
//   attitudes      of the trajectory
//   control        image observations of control points along the path, and of check points, whose positions do not
//                  take part
//
// They form one sparse least squares problem (Ceres, SPARSE_NORMAL_CHOLESKY, one thread, so that the bits are always
// the same).
//
// Weights. A registration is either correct or altogether wrong. A position is good to centimetres, or off by metres
// together with its neighbours. Both get the weight of Geman and McClure, w = (1 + q / c^2)^-2, with q the mean squared
// normalised residual. The adjustment is reweighted several times, while the scale c falls from the accuracy of the
// start to the noise (graduated non-convexity: H. Yang, P. Antonante, V. Tzoumas and L. Carlone, RA-L 2020). For a
// position q is the mean over its neighbours in the pass, and the weight is divided by their number. The errors of a
// trajectory change over tens of frames, so that this many positions count as one.
#pragma once

#include <cstdint>
#include <vector>

#include "geometry/resection/rig_ray.h"
#include "io/block/block.h"

namespace megablock {

using Matrix6 = Eigen::Matrix<double, 6, 6>;

struct ChainLink {
  FrameIndex from, to;
  Pose pose;  // RelativePose::pose; with in_ground its centre is S_to - S_from
  double rotation_sigma_rad = 0, position_sigma_m = 0;
  bool in_ground = false;
};

struct RegistrationLink {
  FrameIndex from, to;
  Pose pose;           // RelativePose::pose
  Matrix6 covariance;  // of Log(R R_estimated') [rad] and of the centre of `to` in the axes of `from` [m]
};

struct ResectedFrame {
  FrameIndex frame;
  Pose pose;
  Matrix6 covariance;  // of PoseIncrement
};

// The image observations of one control point (with a known position) or of a tie point (without).
struct PathPoint {
  struct View {
    FrameIndex frame;
    RigRay ray;
    double sigma_px = 0.5;
  };
  bool known = true;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // known position, with sigma; otherwise the start
  Eigen::Vector3d sigma = Eigen::Vector3d::Constant(0.01);
  std::vector<View> views;
};

// The defaults follow from what a vehicle's positioning gives (Cannelle 2013): successive frames agree to better than a
// centimetre, two passes of one place differ by up to 2 to 4 m, and the stated sigmas are wrong more than half of the
// time. Good positions are therefore good to centimetres, and the first round allows for metres.
struct JointOptions {
  double registration_scale = 3;          // c in the last round, in sigmas
  double first_registration_scale = 300;  // c in the first round
  bool robust_registrations = true;       // false: all have the weight one
  bool use_positions = true;
  double first_position_sigma_m = 2;  // error of the trajectory's positions that the first round allows for
  double position_sigma_m = 0.05;     // sigma of good positions, per axis
  double position_scale = 3;          // c
  int position_neighbours = 50;       // number of frames over which a trajectory's errors stay the same
  bool use_attitudes = true;
  double attitude_sigma_deg = 0.05;  // of the trajectory, about each axis; position_neighbours frames share it
  double first_image_scale = 100, image_scale = 3;  // c of control observations, in sigmas
  int rounds = 10;                                  // rounds of reweighting
  int iterations = 4;                               // at most, in each round but the last
  int last_iterations = 30;
  std::vector<FrameIndex> covariance_of;  // frames whose covariance is computed (for small blocks)
  void check() const;                     // throws InputError
};

struct JointInput {
  std::vector<Pose> start;  // [frames] poses of the trajectory; they are the observed positions and attitudes as well
  std::vector<std::int64_t> pass;     // [frames]
  std::vector<std::uint8_t> located;  // [frames] 1: its position is an observation
  std::vector<ChainLink> chain;
  std::vector<RegistrationLink> registrations;
  std::vector<ResectedFrame> resections;
  std::vector<PathPoint> points;
};

struct JointResult {
  std::vector<Pose> frames;
  std::vector<double> registration_weight;    // [registrations] 0..1
  std::vector<double> registration_residual;  // [registrations] length of the normalised residual (6 numbers)
  std::vector<double> position_weight;        // [frames] 0..1; 0: took no part
  std::vector<Eigen::Vector3d> points;        // [points]
  std::vector<Matrix6> covariances;           // [covariance_of] of PoseIncrement
  int iterations = 0;
  double cost = 0;  // of the last round
};

// Throws ComputeError when the normal equations cannot be solved.
JointResult adjust_jointly(const JointInput& input, const JointOptions& options);

}  // namespace megablock
