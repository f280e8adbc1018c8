#include "io/block/calibration.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "geometry/numbers/angles.h"
#include "geometry/numbers/decompositions.h"

namespace megablock {

namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

double worst_axis(const Eigen::Matrix3d& covariance) {
  return std::sqrt(std::max(0.0, symmetric_eigen(covariance).values(2)));
}

// The root mean square over all directions: one sigma per axis, as priors and the file have it.
double mean_axis(const Eigen::Matrix3d& covariance) { return std::sqrt(std::max(0.0, covariance.trace() / 3)); }

std::string quoted_name(const std::string& name) { return "\"" + name + "\""; }

std::string list_of(const Eigen::Vector3d& v) { return fmt::format("[{}, {}, {}]", v.x(), v.y(), v.z()); }

std::string camera_yaml(const CameraCalibration& camera) {
  const Intrinsics& k = camera.intrinsics;
  const CameraModel& model = k.model();
  std::string text = fmt::format("  {}:\n    model: {}\n", quoted_name(camera.name), model_name(model));
  if (!is_fixed(model, kFocal)) text += fmt::format("    focal_px: {}\n", k[kFocal]);
  text += fmt::format("    principal_point_px: [{}, {}]\n", k[kPrincipalX], k[kPrincipalY]);
  // Fixed parameters follow from the size of the image and are not written.
  std::string distortion, sigma;
  for (int p = 0; p < k.size(); ++p) {
    if (is_fixed(model, p)) continue;
    const auto row = static_cast<std::size_t>(p);
    if (p > kPrincipalY)
      distortion += fmt::format("{}{}: {}", distortion.empty() ? "" : ", ", parameter_name(model, p), k[row]);
    if (camera.sigma[row] > 0)
      sigma += fmt::format("{}{}: {:.3g}", sigma.empty() ? "" : ", ", parameter_name(model, p), camera.sigma[row]);
  }
  if (!distortion.empty()) text += "    distortion: {" + distortion + "}\n";
  if (!sigma.empty()) text += "    sigma: {" + sigma + "}\n";
  return text;
}

std::string mount_yaml(const MountCalibration& m) {
  // X_cam = R (X_rig - C) = R X_rig + t with t = -R C.
  const Eigen::Vector3d translation = -(m.pose.rotation * m.pose.centre);
  return fmt::format("  {}: {{rotation: {}, translation: {}, sigma_rotation_deg: {:.3g}, sigma_position_m: {:.3g}}}\n",
                     quoted_name(m.name), list_of(rotation_log<double>(m.pose.rotation)), list_of(translation),
                     mean_axis(m.covariance.topLeftCorner<3, 3>()) / kDegree,
                     mean_axis(m.covariance.bottomRightCorner<3, 3>()));
}

}  // namespace

void ImageFit::add(const Eigen::Vector2d& residual) {
  squares += residual.squaredNorm();
  lengths += residual.norm();
  ++observations;
}

void ImageFit::add(const ImageFit& other) {
  squares += other.squares;
  lengths += other.lengths;
  observations += other.observations;
}

double ImageFit::rms_px() const {
  // Two coordinates per observation.
  return observations ? std::sqrt(squares / static_cast<double>(2 * observations)) : kUnknown;
}

double ImageFit::mean_px() const { return observations ? lengths / static_cast<double>(observations) : kUnknown; }

double ImageFit::deviation_px() const {
  if (!observations) return kUnknown;
  return std::sqrt(std::max(0.0, squares / static_cast<double>(observations) - mean_px() * mean_px()));
}

double MountCalibration::rotation_sigma_rad() const { return worst_axis(covariance.topLeftCorner<3, 3>()); }
double MountCalibration::position_sigma_m() const { return worst_axis(covariance.bottomRightCorner<3, 3>()); }

double expected_rms_px(const RigCalibration& calibration, double sigma_px) {
  if (calibration.residuals == 0 || !(calibration.redundancy > 0)) return kUnknown;
  // A residual has the expected square sigma^2 r_i, and the r_i add up to the redundancy.
  return sigma_px * std::sqrt(calibration.redundancy / static_cast<double>(calibration.residuals));
}

std::string mount_name(const Block& block, RigIndex rig, std::int32_t mount) {
  const std::span<const Mount> mounts = block.rigs[rig].cameras();
  const CameraIndex camera = mounts[static_cast<std::size_t>(mount)].camera;
  const auto carried =
      std::count_if(mounts.begin(), mounts.end(), [&](const Mount& other) { return other.camera == camera; });
  const std::string& name = block.cameras[camera].name;
  return carried > 1 ? name + "#" + std::to_string(mount) : name;
}

std::string calibration_yaml(const RigCalibration& calibration, const std::string& program) {
  std::string text = fmt::format(
      "# {} calibrate {} ({}): {} frames, {} measurements, rms {:.3f} px ({:.3f} px before).\n"
      "# Take it over in a project file with the line 'calibration: PATH OF THIS FILE'.\n"
      "cameras:\n",
      program, calibration.project, calibration.mode, calibration.frames, calibration.after.images.observations,
      calibration.after.images.rms_px(), calibration.before.images.rms_px());
  for (const CameraCalibration& camera : calibration.cameras) text += camera_yaml(camera);
  if (!calibration.mounts.empty())
    text += "mounts:  # X_cam = rotation X_rig + translation; rotation vectors in radians, metres; posterior sigmas\n";
  for (const MountCalibration& mount : calibration.mounts) text += mount_yaml(mount);
  return text;
}

void apply_calibration(const RigCalibration& calibration, bool hold, Block& block) {
  for (const CameraCalibration& from : calibration.cameras)
    for (Camera& camera : block.cameras) {
      if (camera.name != from.name) continue;
      camera.intrinsics = from.intrinsics;
      camera.focal_known = true;
      camera.prior_sigma = hold ? IntrinsicSigmas{} : from.sigma;
      camera.choose = false;  // the calibration says how well each parameter is known
    }
  for (RigIndex rig(0); block.rigs.contains(rig); ++rig.value)
    for (std::size_t m = 0; m < block.rigs[rig].cameras().size(); ++m) {
      const std::string name = mount_name(block, rig, static_cast<std::int32_t>(m));
      const auto from = std::find_if(calibration.mounts.begin(), calibration.mounts.end(),
                                     [&](const MountCalibration& other) { return other.name == name; });
      if (from == calibration.mounts.end()) continue;
      Mount& mount = block.rigs[rig].mounts[m];
      const double rotation = mean_axis(from->covariance.topLeftCorner<3, 3>());
      const double position = mean_axis(from->covariance.bottomRightCorner<3, 3>());
      // A mount without posterior sigmas, or the reference of the rig, is held fixed.
      const bool known = rotation > 0 && position > 0;
      mount.pose = from->pose;
      mount.rotation_sigma_rad = hold || m == 0 || !known ? 0 : rotation;
      mount.position_sigma_m = hold || m == 0 || !known ? 0 : position;
    }
}

}  // namespace megablock
