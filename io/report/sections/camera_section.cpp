// Writes the section about cameras and mounts.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "geometry/numbers/angles.h"
#include "io/evaluation/feature_statistics.h"
#include "io/evaluation/receivers.h"
#include "io/report/drawing/html.h"
#include "io/report/sections/sections.h"

namespace megablock::report {

namespace {

constexpr double kSignificant = 2;  // a parameter is significant from so many sigmas

// The value of a parameter in an ideal camera: no distortion, and the principal point in the centre.
double neutral(const Camera& camera, int parameter) {
  const Intrinsics start = start_intrinsics(camera.intrinsics.model(), 1, camera.width, camera.height);
  return parameter == kFocal ? 0 : start[static_cast<std::size_t>(parameter)];
}

// A value of a parameter. Coefficients in powers of 1 / px are too small for decimals.
std::string with_digits(ParameterUnit unit, double value, std::string (*decimals)(double, int)) {
  if (unit == ParameterUnit::kInversePixels) return significant(value, 4);
  return decimals(value, unit == ParameterUnit::kPixels ? 2 : 6);
}

// Angle between the rays through the middles of opposite borders, degrees: 2 atan(half / f) for a plane image, half / f
// on each side for a panorama (f = width / 2 pi); for others, their own rays. Distortion is left out where the image is
// plane.
double opening(const Camera& camera, const Intrinsics& k, const Eigen::Vector2d& half) {
  const Eigen::Vector2d centre(0.5 * camera.width, 0.5 * camera.height);
  if (is_panorama(k.model())) return 2 * half.norm() / k[kFocal] * kDegreesPerRadian;
  if (!sees_sideways(k.model())) return 2 * std::atan(half.norm() / k[kFocal]) * kDegreesPerRadian;
  double angle = 0;
  for (const double side : {-1.0, 1.0}) {
    const auto ray = viewing_ray(k, centre + side * half);
    angle += ray ? std::acos(std::clamp(ray->z(), -1.0, 1.0)) * kDegreesPerRadian : 180;
  }
  return angle;
}

// Lower triangle of the correlations of the estimated parameters.
std::string correlation_table(const BlockResult& result, CameraIndex index) {
  if (!result.camera_covariance.contains(index)) return "";
  const Eigen::MatrixXd& c = result.camera_covariance[index];
  const CameraModel& model = result.block.cameras[index].intrinsics.model();
  std::vector<int> estimated;
  for (int k = 0; k < parameter_count(model); ++k)
    if (c(k, k) > 0 && std::isfinite(c(k, k))) estimated.push_back(k);
  if (estimated.size() < 2) return "";
  std::vector<std::string> headings = {"correlation"};
  for (int k : estimated) headings.push_back(parameter_name(model, k));
  Table table(std::move(headings));
  for (std::size_t i = 0; i < estimated.size(); ++i) {
    std::vector<std::string> cells = {parameter_name(model, estimated[i])};
    for (std::size_t j = 0; j <= i; ++j) {
      // r_ij = C_ij / sqrt(C_ii C_jj).
      const double r =
          c(estimated[i], estimated[j]) / std::sqrt(c(estimated[i], estimated[i]) * c(estimated[j], estimated[j]));
      cells.push_back(i == j ? "1"
                             : fmt::format("<span class=r style=\"--r:{:.2f}\">{}</span>",
                                           std::isfinite(r) ? std::min(1.0, std::abs(r)) : 0.0, with_sign(r, 2)));
    }
    cells.resize(estimated.size() + 1);
    table.add(std::move(cells));
  }
  return table.html("correlation");
}

std::string camera_table(const BlockResult& result, CameraIndex index) {
  const Camera& camera = result.block.cameras[index];
  const bool adjusted = result.state.cameras.contains(index), sigmas = result.camera_covariance.contains(index);
  const bool both = result.empirical.camera_covariance.contains(index);
  std::vector<std::string> headings{"parameter", "start", "adjusted", "change", "sigma", "÷ sigma", "prior"};
  if (both) headings.insert(headings.begin() + 5, "empirical sigma");
  Table table(std::move(headings));
  const CameraModel& model = camera.intrinsics.model();
  for (int k = 0; k < parameter_count(model); ++k) {
    const auto at = static_cast<std::size_t>(k);
    const ParameterUnit unit = camera_parameters(model)[at].unit;
    const double start = camera.intrinsics[at], now = adjusted ? result.state.cameras[index][at] : kUnknown;
    const double sigma = sigmas ? std::sqrt(std::max(0.0, result.camera_covariance[index](k, k))) : kUnknown;
    const double prior = camera.prior_sigma[at];
    if (camera_parameters(model)[at].rare && prior == 0 && start == 0) continue;
    const bool held = prior == 0 || sigma == 0;
    const double ratio = held ? kUnknown : std::abs(now - neutral(camera, k)) / sigma;
    // A focal length has no neutral value to be tested against.
    const bool tested = k != kFocal && std::isfinite(ratio);
    std::vector<std::string> cells{parameter_name(model, k) + (unit == ParameterUnit::kPixels ? " [px]" : ""),
                                   with_digits(unit, start, fixed), with_digits(unit, now, fixed),
                                   with_digits(unit, now - start, with_sign), held ? "held" : significant(sigma, 2)};
    if (both) {
      const double empirical = std::sqrt(std::max(0.0, result.empirical.camera_covariance[index](k, k)));
      cells.push_back(held ? "" : significant(empirical, 2));
    }
    cells.push_back(tested ? fixed(ratio, 1) : "");
    cells.push_back(prior == 0 ? "held" : std::isfinite(prior) ? "σ " + significant(prior, 2) : "free");
    table.add(std::move(cells), tested && ratio < kSignificant ? "weak" : "");
  }
  return table.html();
}

// Adds the sigmas along and about the axes of the rig. The cells of a held mount are empty; those of a mount without
// observations are kMissing.
void add_mount_sigmas(const Mount& mount, const BlockResult::Matrix6& covariance, std::vector<std::string>& cells) {
  const PoseIncrement sigma = covariance.diagonal().cwiseMax(0).cwiseSqrt();
  const auto cell = [&](double value) {
    cells.push_back(mount.held() ? "" : value > 0 ? sigma_text(value) : kMissing);
  };
  for (const double position : sigma.tail<3>()) cell(position * 1000);
  for (const double rotation : sigma.head<3>()) cell(rotation * kDegreesPerRadian);
}

std::string mounts_table(const BlockResult& result, RigIndex index) {
  const Rig& rig = result.block.rigs[index];
  if (rig.cameras().size() < 2 || !result.state.mounts.contains(index)) return "";
  const bool sigmas = result.mount_covariance.contains(index) &&
                      std::ranges::any_of(rig.cameras(), [](const Mount& m) { return !m.held(); });
  std::vector<std::string> headings = {
      "mount of " + escape(rig.name), "x [m]", "y [m]", "z [m]", "turned by [°]", "moved by [mm]"};
  if (sigmas)
    headings.insert(headings.end(),
                    {"σx [mm]", "σy [mm]", "σz [mm]", "σ about x [°]", "σ about y [°]", "σ about z [°]"});
  Table table(std::move(headings));
  for (std::size_t m = 0; m < rig.cameras().size() && m < result.state.mounts[index].size(); ++m) {
    const Pose &start = rig.mounts[m].pose, &now = result.state.mounts[index][m];
    const bool held = rig.mounts[m].held();
    std::vector<std::string> cells = {
        count(static_cast<std::int64_t>(m)) + " " + escape(result.block.cameras[rig.mounts[m].camera].name),
        fixed(now.centre.x(), 4),
        fixed(now.centre.y(), 4),
        fixed(now.centre.z(), 4),
        held ? "held" : fixed(start.rotation.angularDistance(now.rotation) * kDegreesPerRadian, 4),
        held ? "held" : fixed((now.centre - start.centre).norm() * 1000, 1)};
    if (sigmas) add_mount_sigmas(rig.mounts[m], result.mount_covariance[index][m], cells);
    table.add(std::move(cells));
  }
  return table.html();
}

// The receivers that the block estimated, in a table of the report.
std::string receivers_table(const BlockResult& result) {
  Table table({"receiver of", "of", "x", "y", "z", "σx", "σy", "σz"});
  const auto add = [&](const std::string& rig, const char* what, const Eigen::Vector3d& value,
                       const Eigen::Vector3d& sigma, int digits) {
    if (sigma.isZero()) return;
    std::vector<std::string> cells = {escape(rig), what};
    for (const double v : value) cells.push_back(fixed(v, digits));
    for (const double s : sigma) cells.push_back(fixed(s, digits));
    table.add(std::move(cells));
  };
  for (const ReceiverFigures& receiver : receivers_of(result)) {
    const std::string& rig = result.block.rigs[receiver.rig].name;
    add(rig, "lever arm [m]", receiver.lever_arm, receiver.lever_arm_sigma, 3);
    add(rig, "change of it [m]", receiver.lever_arm_change, receiver.lever_arm_sigma, 3);
    add(rig, "boresight [°]", receiver.boresight, receiver.boresight_sigma, 4);
  }
  for (const ShiftFigures& group : shifts_of(result)) {
    const std::string& name = result.block.rigs[group.group].name;
    add(name, "shift [m]", group.shift, group.sigma, 3);
    if (const auto [rig, horizontal, height] = group.scale; horizontal != 1 || height != 1)
      table.add({escape(name), "sigmas used / stated", fixed(horizontal, 1), fixed(horizontal, 1), fixed(height, 1), "",
                 "", ""});
  }
  if (table.empty()) return "";
  return "<h3>Receivers</h3>" +
         paragraph(
             "Position of the antenna and rotation vector of the observed attitudes, in the axes of the camera or "
             "rig: x right, y down, z ahead. Shift of a group of positions from the adjusted block: east, north, up.",
             "muted") +
         table.html();
}

std::string interest_points_table(const BlockResult& result) {
  Table table({"interest points of", "images", "least", "most", "mean", "total"});
  const auto statistics = feature_statistics(result);
  for (CameraIndex c(0); statistics.contains(c); ++c.value) {
    const FeatureStatistics& s = statistics[c];
    if (s.images > 0)
      table.add({escape(result.block.cameras[c].name), count(s.images), count(s.least), count(s.most),
                 count(std::llround(s.mean())), count(s.total)});
  }
  return table.empty() ? "" : "<h3>Interest points</h3>" + table.html();
}

std::string readout_line(const Camera& camera) {
  if (camera.readout_s == 0) return "";
  return paragraph("Rolling shutter: " + fixed(1000 * std::abs(camera.readout_s), 1) + " ms from the " +
                       (camera.readout_s > 0 ? "first row to the last" : "last row to the first") +
                       ". Measurements are corrected for the motion in this time, where the times of images tell it.",
                   "muted");
}

}  // namespace

std::string cameras_section(const BlockResult& result, const Figures& f) {
  if (result.block.cameras.empty()) return "";
  std::string body;
  const std::int64_t listed = 20;
  for (CameraIndex camera(0); result.block.cameras.contains(camera) && camera.value < listed; ++camera.value) {
    const Camera& c = result.block.cameras[camera];
    const Intrinsics& k = result.state.cameras.contains(camera) ? result.state.cameras[camera] : c.intrinsics;
    body += "<h3>" + escape(c.name) + "</h3>" +
            paragraph(
                fmt::format("{}, {} × {} px, {}° × {}°, {} oriented images{}", model_name(k.model()), c.width, c.height,
                            fixed(opening(c, k, {0.5 * c.width, 0}), 0), fixed(opening(c, k, {0, 0.5 * c.height}), 0),
                            count(f.camera_images[camera]), c.focal_known ? "" : "; focal length was a guess"),
                "muted") +
            readout_line(c) + (c.choice.empty() ? "" : paragraph("Chosen by the block: " + escape(c.choice) + ".")) +
            camera_table(result, camera) + correlation_table(result, camera);
  }
  if (result.block.cameras.next_index().value > listed)
    body += paragraph("… and " + count(result.block.cameras.next_index().value - listed) + " more cameras.", "muted");
  std::string mounts;
  for (RigIndex rig(0); result.block.rigs.contains(rig) && rig.value < listed; ++rig.value)
    mounts += mounts_table(result, rig);
  if (!mounts.empty()) mounts = "<h3>Mounts</h3>" + mounts;
  const std::string note = paragraph(
      "÷ sigma: difference from a camera without distortion, for the principal point from the centre of the image, "
      "over its sigma. Parameters within " +
          fixed(kSignificant, 0) + " sigma are not significant and shown faint.",
      "muted");
  return section("cameras", "Cameras", note + body + mounts + receivers_table(result) + interest_points_table(result));
}

}  // namespace megablock::report
