// Holds the calibration of a rig, the result of `megablock calibrate`, and writes its file, which a project adopts with
// `calibration:`.
//
// The file is YAML. Cameras are written as in a project file, mounts as in OpenSfM's rig_cameras.json:
// X_cam = R X_rig + t, with R as a rotation vector in radians and t in metres. Posterior standard deviations are added.
// A mount has the name of its camera ("c21"), or "camera0#2" for mount 2 of a rig that carries one camera several
// times.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "io/block/residual_field.h"

namespace megablock {

// Statistics of the residuals of image observations, pixels.
struct ImageFit {
  double squares = 0, lengths = 0;  // sums of squared lengths and of lengths
  std::int64_t observations = 0;
  void add(const Eigen::Vector2d& residual);
  void add(const ImageFit& other);
  double rms_px() const;        // per axis; NaN without observations
  double mean_px() const;       // mean length
  double deviation_px() const;  // standard deviation of the lengths
};

// Adjusted minus given positions of known points that did not enter the adjustment as such.
struct PointFit {
  std::int64_t points = 0;
  double rms_m = 0, mean_m = 0, largest_m = 0;  // of the lengths
  double normalised = 0;                        // root mean square of the components over their sigmas; 0: no sigmas
  bool aligned = false;                         // after a similarity transformation, because the datum is free
};

// The fit of one set of values of a rig.
struct RigFit {
  ImageFit images;
  std::optional<PointFit> check_points;
};

inline constexpr const char* kQuadrants[] = {"upper left", "upper right", "lower left", "lower right"};

struct MountCalibration {
  RigIndex rig;
  std::int32_t mount = 0;
  CameraIndex camera;
  std::string name;
  bool held = false;
  Pose start, pose;
  // Posterior covariance of PoseIncrement (radians, metres): rotation about the axes of the rig, projection centre in
  // the rig.
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  bool rotation_determined = true, position_determined = true;  // by the observations, not only by the prior
  std::int64_t images = 0;                                      // number of images with an observation that takes part
  ImageFit before, after;                  // with the initial rig (frames and points adjusted), and the result
  ResidualField field;                     // of the result
  std::array<std::int64_t, 4> quadrant{};  // number of observations, in the order of kQuadrants

  // Standard deviation of the least certain axis.
  double rotation_sigma_rad() const;
  double position_sigma_m() const;
};

struct CameraCalibration {
  std::string name;
  Intrinsics start, intrinsics;
  IntrinsicSigmas sigma{};  // posterior; 0: held fixed
};

struct RigCalibration {
  std::string project, mode;  // "off-line", for example
  std::vector<CameraCalibration> cameras;
  std::vector<MountCalibration> mounts;
  // Statistics of the adjustment.
  std::int64_t frames = 0, points = 0, control_points = 0;
  std::int64_t residuals = 0;  // number of scalar residuals of image observations
  double redundancy = 0;       // redundancy of these, without the share of the other observations
  std::int64_t iterations = 0;
  double seconds = 0;
  double sigma0 = 0, image_sigma_px = 0;  // a posteriori; standard deviation of an observation of a tie point
  RigFit before, after;
  // Robust standard deviation per axis of the observations that took no part, from the median of their residuals,
  // pixels; NaN if there are none.
  double held_out_before_px = 0, held_out_px = 0;
  std::int64_t held_out = 0;
  std::optional<RigFit> verification_before, verification;  // on another site
  std::string gauge;
  std::vector<std::string> warnings;
  std::string refused;  // the reason why the result is no better than the start; empty if it is
};

// The root mean square residual per axis that noise of `sigma_px` would leave, pixels.
double expected_rms_px(const RigCalibration& calibration, double sigma_px);

// The name of a mount in files and tables.
std::string mount_name(const Block& block, RigIndex rig, std::int32_t mount);

// The text of the calibration file.
std::string calibration_yaml(const RigCalibration& calibration, const std::string& program);

// Replaces cameras and mounts of a block by those of the same name in a calibration. They are held fixed, or get the
// posterior standard deviations as priors; the reference of a rig stays held. Names that only one of the two has are
// left unchanged.
void apply_calibration(const RigCalibration& calibration, bool hold, Block& block);

}  // namespace megablock
