// Writes the page of a rig calibration: mounts, residuals, and the distribution of the observations over the sensor of
// each camera.
#include "io/report/calibration_page.h"

#include <fmt/core.h>

#include <cmath>

#include "geometry/numbers/angles.h"
#include "io/evaluation/calibration_report.h"
#include "io/report/drawing/drawing.h"
#include "io/report/drawing/html.h"
#include "io/report/drawing/page.h"

namespace megablock {

namespace {

using namespace report;

constexpr std::int64_t kFew = 4;  // a quadrant of the sensor with fewer observations is not covered

std::string in_pixels(double value) { return fixed(value, 3) + " px"; }

std::string quadrant_text(const MountCalibration& mount) {
  std::string text;
  for (std::size_t q = 0; q < mount.quadrant.size(); ++q) text += (q ? " / " : "") + count(mount.quadrant[q]);
  return text;
}

bool covered(const MountCalibration& mount) {
  return std::none_of(mount.quadrant.begin(), mount.quadrant.end(), [](std::int64_t n) { return n < kFew; });
}

std::string mounts_table(const RigCalibration& c) {
  Table table({"camera", "moved [mm]", "σ [mm]", "turned [°]", "σ [°]", "images", "measurements", "rms before [px]",
               "rms [px]", "in quadrants"});
  for (const MountCalibration& m : c.mounts) {
    const bool determined = m.position_determined && m.rotation_determined;
    table.add({escape(m.name), m.held ? "held" : fixed(1e3 * (m.pose.centre - m.start.centre).norm(), 2),
               m.held ? "" : sigma_text(1e3 * m.position_sigma_m()),
               m.held ? "held" : fixed(m.start.rotation.angularDistance(m.pose.rotation) * kDegreesPerRadian, 4),
               m.held ? "" : sigma_text(m.rotation_sigma_rad() * kDegreesPerRadian), count(m.images),
               count(m.field.observations), fixed(m.before.rms_px(), 3), fixed(m.after.rms_px(), 3), quadrant_text(m)},
              determined && covered(m) ? "" : "look");
  }
  return table.html();
}

// Adds the rows that compare points before and after: number, rms, largest, rms over sigma.
void add_points(Table& table, const std::string& what, const std::optional<PointFit>& before,
                const std::optional<PointFit>& after) {
  if (!before && !after) return;
  const auto cell = [](const std::optional<PointFit>& fit, const auto& text) { return fit ? text(*fit) : kMissing; };
  const auto row = [&](const std::string& name, const auto& text) {
    table.add({what + name, cell(before, text), cell(after, text)});
  };
  row(", number", [](const PointFit& fit) { return count(fit.points) + (fit.aligned ? ", after a similarity" : ""); });
  row(", rms", [](const PointFit& fit) { return fixed(1e3 * fit.rms_m, 1) + " mm"; });
  row(", largest", [](const PointFit& fit) { return fixed(1e3 * fit.largest_m, 1) + " mm"; });
  row(", rms ÷ σ", [](const PointFit& fit) { return fit.normalised > 0 ? fixed(fit.normalised, 2) : kMissing; });
}

std::string comparison_table(const RigCalibration& c) {
  Table table({"", "rig at the start", "rig as calibrated"});
  table.add({"residuals, rms per axis", in_pixels(c.before.images.rms_px()), in_pixels(c.after.images.rms_px())});
  table.add({"residuals, mean length ± deviation",
             fixed(c.before.images.mean_px(), 2) + " ± " + fixed(c.before.images.deviation_px(), 2) + " px",
             fixed(c.after.images.mean_px(), 2) + " ± " + fixed(c.after.images.deviation_px(), 2) + " px"});
  if (c.held_out > 0)
    table.add({count(c.held_out) + " points held out, from the median", in_pixels(c.held_out_before_px),
               in_pixels(c.held_out_px)});
  add_points(table, "check points", c.before.check_points, c.after.check_points);
  if (c.verification && c.verification_before) {
    table.add({"verification site, rms per axis", in_pixels(c.verification_before->images.rms_px()),
               in_pixels(c.verification->images.rms_px())});
    add_points(table, "its check points", c.verification_before->check_points, c.verification->check_points);
  }
  return table.html();
}

std::string remarks(const RigCalibration& c) {
  std::string list;
  if (!c.refused.empty()) list += "<li class=bad>Refused: " + escape(c.refused) + ".</li>";
  for (const std::string& warning : c.warnings) list += "<li class=look>" + escape(warning) + ".</li>";
  if (list.empty()) list = "<li class=good>Every mount is determined and every sensor covered.</li>";
  return "<ul class=assessment>" + list + "</ul>\n";
}

std::string cameras_table(const RigCalibration& c) {
  Table table({"camera", "parameter", "start", "calibrated", "σ"}, 2);
  for (const CameraCalibration& camera : c.cameras)
    for (int k = 0; k < camera.intrinsics.size(); ++k) {
      const auto at = static_cast<std::size_t>(k);
      if (camera.sigma[at] == 0) continue;
      table.add({escape(camera.name), parameter_name(camera.intrinsics.model(), k), significant(camera.start[at], 6),
                 significant(camera.intrinsics[at], 6), significant(camera.sigma[at], 2)});
    }
  return table.empty() ? "" : section("intrinsics", "Cameras", table.html());
}

std::string coverage(const RigCalibration& c, const Block& block) {
  std::string body;
  for (const MountCalibration& m : c.mounts) {
    const FieldDrawing residuals = draw(m.field, block.cameras[m.camera]);
    body += "<h3>" + escape(m.name) + "</h3><div class=row>" +
            figure(draw_density(m.field, block.cameras[m.camera]),
                   fmt::format("{} measurements; in the quadrants {} (upper left / upper right / lower left / lower "
                               "right). White: none.",
                               count(m.field.observations), quadrant_text(m))) +
            figure(residuals.svg, residuals.caption) + "</div>";
  }
  return section("coverage", "Coverage of the sensors", body);
}

}  // namespace

std::string calibration_html(const RigCalibration& c, const Block& block) {
  const std::string body =
      remarks(c) +
      section("mounts", "Mounts",
              mounts_table(c) +
                  paragraph("σ: posterior sigma of the least certain axis. Residuals before: with the rig at the start "
                            "and adjusted frames and points.",
                            "muted")) +
      section("comparison", "Compared with the start", comparison_table(c)) + coverage(c, block) + cameras_table(c);
  return page("Rig calibration: " + escape(c.project),
              fmt::format("{}, {} frames, {} points, {} control points, {} measurements; σ₀ {}, datum {}", c.mode,
                          count(c.frames), count(c.points), count(c.control_points), count(c.after.images.observations),
                          fixed(c.sigma0, 3), escape(c.gauge)),
              body, calibration_json(c));
}

}  // namespace megablock
