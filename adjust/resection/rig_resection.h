// Gives the pose of a rig from known points observed by any of its cameras ("relevement", Cannelle 2013).
//
// Samples of three points give poses by generalised P3P (geometry/resection/gp3p.h), and all observations judge each
// pose (geometry/estimation/ransac.h). Levenberg-Marquardt iterations over the inliers follow. The residuals are
// whitened by the covariances of observation and point (rig_sights.h), so that the sigmas of the points enter the
// choice, the weights and the covariance of the pose. An approximate pose, such as that of the trajectory, takes part
// as an observation with its sigmas. It decides between the solutions of three points and stabilises configurations
// near a critical surface.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "adjust/resection/rig_sights.h"

namespace megablock {

struct RigResectionOptions {
  double max_error_sigmas = 4;        // length of the whitened residual of an agreeing sight
  int samples = 500;                  // of three points; fewer where there are fewer triplets or the agreement is clear
  int min_points = 3;                 // agreeing points
  double min_share = 0.4;             // agreeing points / all
  double min_line_ratio = 0.02;       // spread of the points across their line / along it; below: aligned, refused
  double max_position_sigma_m = 0.1;  // of the result, length; above (points near a critical surface): refused
  double warn_angle_deg = 20;         // largest angle between two agreeing points seen from the rig; below: warning
  void check() const;                 // throws InputError
};

struct ApproximatePose {
  Pose pose;
  double position_sigma_m = 3;        // per axis
  double rotation_sigma_rad = 0.002;  // about each axis
};

struct RigResection {
  Pose pose;                                                                     // ground -> rig
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();  // of PoseIncrement, a priori
  std::vector<std::uint8_t> agrees;                                              // [sights]
  int points = 0;                                                                // agreeing ones
  double rms_px = 0;                                                             // of the agreeing sights, per axis
  double angle_deg = 0;                                                          // largest between agreeing points
  std::vector<std::string> warnings;
};

// Deterministic: samples depend on `seed` and the order of the sights alone.
// Throws ComputeError saying what is missing: fewer than three points, points on one line, no agreement, several poses
// possible, position not determined.
RigResection resect_rig(std::span<const RigSight> sights, const RigResectionOptions& options, std::uint64_t seed,
                        const std::optional<ApproximatePose>& approximate = {});

}  // namespace megablock
