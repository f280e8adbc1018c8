#include "io/evaluation/calibration_report.h"

#include <fmt/core.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "geometry/numbers/angles.h"
#include "io/text/counted.h"

namespace megablock {

namespace {

using OrderedJson = nlohmann::ordered_json;

// JSON has no NaN; an unknown figure is null.
OrderedJson number(double value) { return std::isfinite(value) ? OrderedJson(value) : OrderedJson(nullptr); }

OrderedJson fit_json(const RigFit& fit) {
  OrderedJson json{{"measurements", fit.images.observations},
                   {"rms_px", number(fit.images.rms_px())},
                   {"mean_px", number(fit.images.mean_px())},
                   {"deviation_px", number(fit.images.deviation_px())}};
  if (fit.check_points) {
    const PointFit& points = *fit.check_points;
    json["check_points"] = {{"points", points.points},         {"rms_m", points.rms_m},
                            {"mean_m", points.mean_m},         {"largest_m", points.largest_m},
                            {"normalised", points.normalised}, {"aligned", points.aligned}};
  }
  return json;
}

OrderedJson mount_json(const MountCalibration& m) {
  return {{"name", m.name},
          {"held", m.held},
          // Relative to the mount at the start: the length of the shift, and the angle of the whole rotation.
          {"moved_m", (m.pose.centre - m.start.centre).norm()},
          {"turned_deg", m.start.rotation.angularDistance(m.pose.rotation) * kDegreesPerRadian},
          {"position_sigma_m", m.position_sigma_m()},
          {"rotation_sigma_deg", m.rotation_sigma_rad() * kDegreesPerRadian},
          {"position_determined", m.position_determined},
          {"rotation_determined", m.rotation_determined},
          {"images", m.images},
          {"measurements", m.field.observations},
          {"rms_before_px", number(m.before.rms_px())},
          {"rms_px", number(m.after.rms_px())},
          {"quadrants", m.quadrant}};
}

std::string point_text(const std::optional<PointFit>& fit) {
  if (!fit) return "-";
  std::string text = fmt::format("{:.1f} mm rms, {:.1f} mm largest", 1e3 * fit->rms_m, 1e3 * fit->largest_m);
  if (fit->normalised > 0) text += fmt::format(", {:.2f} sigma rms", fit->normalised);
  return text;
}

std::string comparison(const std::string& what, const std::string& before, const std::string& after) {
  return fmt::format("{:<28}{} -> {}\n", what, before, after);
}

std::string px(double value) { return std::isfinite(value) ? fmt::format("{:.3f} px", value) : "-"; }

std::string mount_line(const MountCalibration& m) {
  const auto column = [](double value) { return std::isfinite(value) ? fmt::format("{:.3f}", value) : "-"; };
  const std::string counted =
      fmt::format("{:>8}{:>11}{:>9}   {} {} {} {}\n", m.field.observations, column(m.before.rms_px()),
                  column(m.after.rms_px()), m.quadrant[0], m.quadrant[1], m.quadrant[2], m.quadrant[3]);
  if (m.held) return fmt::format("{:<14}{:<40}", m.name, "held") + counted;
  return fmt::format("{:<14}{:>8.2f}{:>9.2f}{:>11.4f}{:>11.4f} ", m.name, 1e3 * (m.pose.centre - m.start.centre).norm(),
                     1e3 * m.position_sigma_m(), m.start.rotation.angularDistance(m.pose.rotation) * kDegreesPerRadian,
                     m.rotation_sigma_rad() * kDegreesPerRadian) +
         counted;
}

}  // namespace

std::string calibration_text(const RigCalibration& c) {
  std::string text = fmt::format("{:<14}{:>8}{:>9}{:>11}{:>11} {:>8}{:>11}{:>9}   {}\n", "camera", "moved", "sigma",
                                 "turned", "sigma", "meas.", "rms before", "after", "in quadrants");
  text += fmt::format("{:<14}{:>8}{:>9}{:>11}{:>11} {:>8}{:>11}{:>9}   {}\n", "", "mm", "mm", "deg", "deg", "", "px",
                      "px", "ul ur ll lr");
  for (const MountCalibration& mount : c.mounts) text += mount_line(mount);
  text += fmt::format(
      "\n{}: {} frames, {} points, {} control points; redundancy {:.0f} of {} residuals, sigma0 {:.3f}, {}, "
      "{:.1f} "
      "s\n",
      c.mode, c.frames, c.points, c.control_points, c.redundancy, c.residuals, c.sigma0, counted(c.iterations, "step"),
      c.seconds);
  const auto images = [](const ImageFit& fit) {
    if (fit.observations == 0) return std::string("-");
    return fmt::format("{} ({:.2f} px mean length, {:.2f} px deviation)", px(fit.rms_px()), fit.mean_px(),
                       fit.deviation_px());
  };
  text += comparison("rms per axis", images(c.before.images), images(c.after.images));
  if (c.held_out > 0)
    text += comparison(fmt::format("{} points held out", c.held_out), px(c.held_out_before_px), px(c.held_out_px));
  if (c.before.check_points || c.after.check_points) {
    const auto& fit = c.after.check_points ? c.after.check_points : c.before.check_points;
    text += comparison(fmt::format("{} check points{}", fit->points, fit->aligned ? ", aligned" : ""),
                       point_text(c.before.check_points), point_text(c.after.check_points));
  }
  if (c.verification && c.verification_before) {
    text += comparison("verification site", images(c.verification_before->images), images(c.verification->images));
    if (c.verification->check_points)
      text += comparison(fmt::format("  its {} check points", c.verification->check_points->points),
                         point_text(c.verification_before->check_points), point_text(c.verification->check_points));
  }
  text += "datum: " + c.gauge + "\n";
  for (const std::string& warning : c.warnings) text += "warning: " + warning + "\n";
  return text;
}

std::string calibration_json(const RigCalibration& c) {
  OrderedJson json{{"project", c.project},
                   {"mode", c.mode},
                   {"frames", c.frames},
                   {"points", c.points},
                   {"control_points", c.control_points},
                   {"residuals", c.residuals},
                   {"redundancy", number(c.redundancy)},
                   {"iterations", c.iterations},
                   {"sigma0", number(c.sigma0)},
                   {"image_sigma_px", number(c.image_sigma_px)},
                   {"before", fit_json(c.before)},
                   {"after", fit_json(c.after)},
                   {"held_out", c.held_out},
                   {"held_out_before_px", number(c.held_out_before_px)},
                   {"held_out_px", number(c.held_out_px)}};
  if (c.verification_before) json["verification_before"] = fit_json(*c.verification_before);
  if (c.verification) json["verification"] = fit_json(*c.verification);
  json["datum"] = c.gauge;
  json["mounts"] = OrderedJson::array();
  for (const MountCalibration& mount : c.mounts) json["mounts"].push_back(mount_json(mount));
  json["cameras"] = OrderedJson::object();
  for (const CameraCalibration& camera : c.cameras) {
    OrderedJson& entry = json["cameras"][camera.name];
    for (int k = 0; k < camera.intrinsics.size(); ++k)
      entry[parameter_name(camera.intrinsics.model(), k)] = {{"value", camera.intrinsics[static_cast<std::size_t>(k)]},
                                                             {"sigma", camera.sigma[static_cast<std::size_t>(k)]}};
  }
  json["warnings"] = c.warnings;
  json["refused"] = c.refused;
  return json.dump(1, ' ', false, OrderedJson::error_handler_t::replace);
}

}  // namespace megablock
