// The calibration of a rig: what `megablock calibrate` leaves, and the file by which a project takes it over
// (`calibration:` of the project file).
//
// The file is YAML; cameras as in a project file, mounts as in OpenSfM's rig_cameras.json (X_cam = R X_rig + t, R by
// its rotation vector in radians, t in metres), posterior sigmas beside them. Mounts go by the name of their camera
// ("c21"; "camera0#2" for mount 2 of a rig that carries one camera several times).
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "io/block/residual_field.h"

namespace megablock {

// Residuals of image measurements, pixels.
struct ImageFit {
  double squares = 0, lengths = 0;  // sums of squared lengths and of lengths
  std::int64_t observations = 0;
  void add(const Eigen::Vector2d& residual);
  void add(const ImageFit& other);
  double rms_px() const;        // per axis; NaN without observations
  double mean_px() const;       // of the lengths
  double deviation_px() const;  // standard deviation of the lengths
};

// Adjusted minus given positions of points that are known and did not take part as such.
struct PointFit {
  std::int64_t points = 0;
  double rms_m = 0, mean_m = 0, largest_m = 0;  // lengths
  double normalised = 0;                        // root mean square of the components over their sigmas; 0: no sigmas
  bool aligned = false;                         // after a similarity, because the datum is free
};

// How well one set of values of a rig fits.
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
  // Posterior, of PoseIncrement (rad, m): rotation about the axes of the rig, projection centre in the rig.
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  bool rotation_determined = true, position_determined = true;  // by the measurements, not by the prior alone
  std::int64_t images = 0;                                      // with a measurement that takes part
  ImageFit before, after;                                       // rig at the start (frames and points adjusted), result
  ResidualField field;                                          // of the result
  std::array<std::int64_t, 4> quadrant{};                       // measurements, in the order of kQuadrants

  // Of the worst axis.
  double rotation_sigma_rad() const;
  double position_sigma_m() const;
};

struct CameraCalibration {
  std::string name;
  Intrinsics start, intrinsics;
  IntrinsicSigmas sigma{};  // posterior; 0: held
};

struct RigCalibration {
  std::string project, mode;  // "off-line" ...
  std::vector<CameraCalibration> cameras;
  std::vector<MountCalibration> mounts;
  // The adjustment.
  std::int64_t frames = 0, points = 0, control_points = 0;
  std::int64_t residuals = 0;  // of image measurements, scalar
  double redundancy = 0;       // of these: what the other observations take is off
  std::int64_t iterations = 0;
  double seconds = 0;
  double sigma0 = 0, image_sigma_px = 0;  // a posteriori; of tie point measurements
  RigFit before, after;
  // Of measurements that took no part: robust sigma per axis from the median of the residuals, px; NaN: none.
  double held_out_before_px = 0, held_out_px = 0;
  std::int64_t held_out = 0;
  std::optional<RigFit> verification_before, verification;  // on another site
  std::string gauge;
  std::vector<std::string> warnings;
  std::string refused;  // why this is no better than the start; empty: it is
};

// Root mean square residual per axis that noise of `sigma_px` leaves.
double expected_rms_px(const RigCalibration& calibration, double sigma_px);

// Name of a mount in files and tables.
std::string mount_name(const Block& block, RigIndex rig, std::int32_t mount);

// The file of a calibration.
std::string calibration_yaml(const RigCalibration& calibration, const std::string& program);

// Cameras and mounts of a calibration put in place of those of the same name in a block: held, or with the posterior
// sigmas as priors (the reference of a rig stays held). Names that only one of the two has are left alone.
void apply_calibration(const RigCalibration& calibration, bool hold, Block& block);

}  // namespace megablock
