// Gives the pose of a rig from known points observed by any of its cameras ("relevement", Cannelle 2013).
//
// Samples of three points give poses by generalised P3P (geometry/resection/gp3p.h), and all observations judge each
// pose (geometry/estimation/ransac.h). Levenberg-Marquardt iterations over the inliers follow. The residuals are
// whitened by the covariances of observation and point (observed_points.h), so that the sigmas of the points enter the
// choice, the weights and the covariance of the pose. An approximate pose, such as that of the trajectory, takes part
// as an observation with its sigmas. It decides between the solutions of three points and stabilises configurations
// near a critical surface.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "adjust/resection/observed_points.h"

namespace megablock {

// Points on one line do not determine the rotation about it, and points within 20 degrees determine the pose weakly
// (Cannelle 2013). The first is refused, the second is warned of.
struct RigResectionOptions {
  double max_error_sigmas = 4;   // length of the whitened residual of an inlier
  int samples = 500;             // samples of three points; fewer when there are fewer triplets or the result is clear
  int min_points = 3;            // inlier points
  double min_share = 0.4;        // inlier points / all points
  double min_line_ratio = 0.02;  // spread of the points across their line / along it; a smaller one is refused
  double max_position_sigma_m = 0.1;  // of the result, length; a larger one (points near a critical surface) is refused
  // The largest angle between two inlier points, seen from the rig; a smaller one gives a warning.
  double warn_angle_deg = 20;
  void check() const;  // throws InputError
};

struct ApproximatePose {
  Pose pose;
  double position_sigma_m = 3;        // per axis
  double rotation_sigma_rad = 0.002;  // about each axis
};

struct RigResection {
  Pose pose;                                                                     // ground -> rig
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();  // of PoseIncrement, a priori
  std::vector<std::uint8_t> agrees;                                              // [observations] 1: inlier
  int points = 0;                                                                // inlier points
  double rms_px = 0;                                                             // of the inlier observations, per axis
  double angle_deg = 0;  // largest angle between two inlier points
  std::vector<std::string> warnings;
};

// Deterministic: samples depend on `seed` and on the order of the observations alone. Throws ComputeError with the
// reason: fewer than three points, points on one line, no pose with enough inliers, several possible poses, or a
// position that is not determined.
RigResection resect_rig(std::span<const ObservedPoint> observations, const RigResectionOptions& options,
                        std::uint64_t seed, const std::optional<ApproximatePose>& approximate = {});

}  // namespace megablock
