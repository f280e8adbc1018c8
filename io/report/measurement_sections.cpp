// Positions, control, cameras, accuracy: what is measured in metres and radians.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "io/report/drawing.h"
#include "io/report/html.h"
#include "io/report/sections.h"

namespace megablock::report {

namespace {

constexpr double kDegrees = 180 / std::numbers::pi;
constexpr std::size_t kListed = 100;

double largest(const std::vector<Eigen::Vector3d>& values) {
  double result = 0;
  for (const Eigen::Vector3d& v : values)
    for (double c : v)
      if (std::isfinite(c)) result = std::max(result, std::abs(c));
  return result;
}

void axes_cells(const Eigen::Vector3d& v, const LengthUnit& unit, bool sign, std::vector<std::string>& cells) {
  for (double c : v)
    cells.push_back(sign ? with_sign(c * unit.factor, unit.decimals) : fixed(c * unit.factor, unit.decimals));
}

void add_row(Table& table, const std::string& name, const Eigen::Vector3d& v, const LengthUnit& unit, bool sign) {
  std::vector<std::string> cells = {name};
  axes_cells(v, unit, sign, cells);
  table.add(std::move(cells));
}

std::string in_unit(const std::string& name, const LengthUnit& unit) { return name + " [" + unit.name + "]"; }

}  // namespace

std::string positions_section(const BlockResult& result, const Figures& f) {
  if (f.positions.empty()) return "";
  std::vector<Eigen::Vector3d> differences, sigmas, normalised;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero(), extreme = Eigen::Vector3d::Zero();
  for (const PositionResidual& r : f.positions) {
    differences.push_back(r.difference);
    sigmas.push_back(r.sigma);
    normalised.push_back(r.difference.cwiseQuotient(r.sigma));
    mean += r.difference / static_cast<double>(f.positions.size());
    extreme = extreme.cwiseMax(r.difference.cwiseAbs());
  }
  const Eigen::Vector3d rms = root_mean_square(differences), ratio = root_mean_square(normalised);
  const LengthUnit unit = length_unit(largest(differences));
  Table table({in_unit("adjusted − GNSS", unit), "east", "north", "up"});
  add_row(table, "root mean square", rms, unit, false);
  add_row(table, "mean", mean, unit, true);
  add_row(table, "largest", extreme, unit, false);
  add_row(table, "stated sigma (rms)", root_mean_square(sigmas), unit, false);
  table.add({"rms of residual ÷ sigma", fixed(ratio.x(), 2), fixed(ratio.y(), 2), fixed(ratio.z(), 2)});

  std::vector<std::size_t> order(f.positions.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  const auto size = [&](std::size_t i) { return normalised[i].cwiseAbs().maxCoeff(); };
  const std::size_t listed = std::min<std::size_t>(5, order.size());
  std::partial_sort(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(listed), order.end(),
                    [&](std::size_t a, std::size_t b) { return std::pair(-size(a), a) < std::pair(-size(b), b); });
  Table worst({in_unit("largest ÷ sigma", unit), "east", "north", "up", "× sigma"});
  for (std::size_t i = 0; i < listed; ++i) {
    const PositionResidual& r = f.positions[order[i]];
    std::vector<std::string> cells = {escape(result.block.frames[r.frame].name)};
    axes_cells(r.difference, unit, true, cells);
    cells.push_back(fixed(size(order[i]), 1));
    worst.add(std::move(cells), size(order[i]) > 5 ? "look" : "");
  }
  std::string body =
      paragraph(fmt::format("{} of {} oriented frames carry a GNSS position. Lever arms are applied.",
                            count(static_cast<std::int64_t>(f.positions.size())), count(f.oriented_frames)));
  body += "<div class=row><div class=aside>" + table.html() + "</div><div class=aside>" + worst.html() + "</div>" +
          figure(draw_horizontal(f.positions), "Horizontal residuals.") +
          figure(draw_vertical(f.positions), "Vertical residuals, frame by frame.") + "</div>";
  if (!f.attitude_deg.empty()) {
    const Spread angle = spread(f.attitude_deg);
    body +=
        paragraph(fmt::format("Attitude: {} frames with observed angles; adjusted and observed differ by {}° (median), "
                              "{}° (95 %), {}° (largest).",
                              count(static_cast<std::int64_t>(f.attitude_deg.size())), significant(angle.median),
                              significant(angle.p95), significant(angle.largest)));
  }
  return section("positions", "GNSS residuals", body);
}

namespace {

void add_point_rows(const BlockResult& result, const Figures& f, PointRole role, const LengthUnit& unit, Table& table) {
  std::vector<Eigen::Vector3d> differences;
  double squares = 0;
  std::int64_t images = 0, points = 0;
  for (const PointResidual& r : f.points) {
    const ControlPoint& point = result.block.control_points[r.point];
    if (point.role != role) continue;
    differences.push_back(r.difference);
    if (r.images) squares += r.rms_px * r.rms_px * r.images;
    images += r.images;
    if (static_cast<std::size_t>(++points) > kListed) continue;
    std::vector<std::string> cells = {escape(point.name), role == PointRole::kCheck ? "check" : "control"};
    axes_cells(r.difference, unit, true, cells);
    Eigen::Vector3d sigma = point.sigma;
    if (role == PointRole::kCheck && r.point < result.control.size())
      sigma = result.control[r.point].covariance.diagonal().cwiseMax(0).cwiseSqrt() +
              Eigen::Vector3d::Constant(result.control[r.point].covariance.allFinite() ? 0 : kUnknown);
    axes_cells(sigma, unit, false, cells);
    cells.push_back(fmt::format("{} of {}", r.images, point.measurements.size()));
    cells.push_back(fixed(r.rms_px, 2));
    table.add(std::move(cells), r.difference.allFinite() ? "" : "muted");
  }
  if (points == 0) return;
  std::vector<std::string> cells = {fmt::format("rms of {}", count(points)),
                                    role == PointRole::kCheck ? "check" : "control"};
  axes_cells(root_mean_square(differences), unit, false, cells);
  cells.insert(cells.end(), {"", "", "", count(images),
                             fixed(images ? std::sqrt(squares / static_cast<double>(images)) : kUnknown, 2)});
  table.add(std::move(cells), "sum");
}

}  // namespace

std::string control_section(const BlockResult& result, const Figures& f) {
  if (f.points.empty()) return "";
  std::vector<Eigen::Vector3d> differences;
  for (const PointResidual& r : f.points) differences.push_back(r.difference);
  const LengthUnit unit = length_unit(largest(differences));
  Table table({"point", "role", in_unit("ΔE", unit), in_unit("ΔN", unit), in_unit("ΔU", unit), in_unit("σE", unit),
               in_unit("σN", unit), in_unit("σU", unit), "images", "rms [px]"},
              2);
  add_point_rows(result, f, PointRole::kControl, unit, table);
  add_point_rows(result, f, PointRole::kCheck, unit, table);
  return section(
      "control", "Control and check points",
      paragraph("Differences adjusted − given. Sigmas: of a control point as stated, of a check point as adjusted "
                "(it takes no part in the datum).") +
          table.html());
}

namespace {

std::string camera_table(const BlockResult& result, CameraIndex index) {
  const Camera& camera = result.block.cameras[index];
  const bool adjusted = result.state.cameras.contains(index), sigmas = result.camera_covariance.contains(index);
  Table table({"parameter", "start", "adjusted", "change", "sigma", "prior"});
  for (int k = 0; k < kIntrinsicCount; ++k) {
    const auto at = static_cast<std::size_t>(k);
    const bool pixels = k <= kPrincipalY;
    const double start = camera.intrinsics[at], now = adjusted ? result.state.cameras[index][at] : kUnknown;
    const double sigma = sigmas ? std::sqrt(std::max(0.0, result.camera_covariance[index](k, k))) : kUnknown;
    const double prior = camera.prior_sigma[at];
    const int decimals = pixels ? 2 : 6;
    table.add({std::string(kIntrinsicNames[at]) + (pixels ? " [px]" : ""), fixed(start, decimals), fixed(now, decimals),
               with_sign(now - start, decimals),
               prior == 0   ? "held"
               : sigma == 0 ? "held"
               : pixels     ? fixed(sigma, 3)
                            : significant(sigma, 2),
               prior == 0             ? "held"
               : std::isfinite(prior) ? "σ " + significant(prior, 2)
                                      : "free"});
  }
  return table.html();
}

std::string mounts_table(const BlockResult& result, RigIndex index) {
  const Rig& rig = result.block.rigs[index];
  if (rig.mounts.size() < 2 || !result.state.mounts.contains(index)) return "";
  Table table({"mount of " + escape(rig.name), "x [m]", "y [m]", "z [m]", "turned by [°]", "moved by [mm]"});
  for (std::size_t m = 0; m < rig.mounts.size() && m < result.state.mounts[index].size(); ++m) {
    const Pose &start = rig.mounts[m].pose, &now = result.state.mounts[index][m];
    const bool held = rig.mounts[m].held();
    table.add({count(static_cast<std::int64_t>(m)) + " " + escape(result.block.cameras[rig.mounts[m].camera].name),
               fixed(now.centre.x(), 4), fixed(now.centre.y(), 4), fixed(now.centre.z(), 4),
               held ? "held" : fixed(start.rotation.angularDistance(now.rotation) * kDegrees, 4),
               held ? "held" : fixed((now.centre - start.centre).norm() * 1000, 1)});
  }
  return table.html();
}

}  // namespace

std::string cameras_section(const BlockResult& result, const Figures& f) {
  if (result.block.cameras.empty()) return "";
  std::string body;
  const std::int64_t listed = 20;
  for (CameraIndex camera(0); result.block.cameras.contains(camera) && camera.value < listed; ++camera.value) {
    const Camera& c = result.block.cameras[camera];
    const double focal =
        result.state.cameras.contains(camera) ? result.state.cameras[camera][kFocal] : c.intrinsics[kFocal];
    body += "<div class=aside><h3>" + escape(c.name) + "</h3>" +
            paragraph(fmt::format("{} × {} px, {}° × {}°, {} oriented images{}", c.width, c.height,
                                  fixed(2 * std::atan(c.width / (2 * focal)) * kDegrees, 0),
                                  fixed(2 * std::atan(c.height / (2 * focal)) * kDegrees, 0),
                                  count(f.camera_images[camera]), c.focal_known ? "" : "; focal length was a guess"),
                      "muted") +
            camera_table(result, camera) + "</div>";
  }
  if (result.block.cameras.next_index().value > listed)
    body += paragraph("… and " + count(result.block.cameras.next_index().value - listed) + " more cameras.", "muted");
  std::string mounts;
  for (RigIndex rig(0); result.block.rigs.contains(rig) && rig.value < listed; ++rig.value)
    mounts += mounts_table(result, rig);
  if (!mounts.empty()) mounts = "<h3>Mounts</h3>" + mounts;
  return section("cameras", "Cameras", "<div class=row>" + body + "</div>" + mounts);
}

std::string accuracy_section(const BlockResult& result, const Figures& f) {
  if (!std::isfinite(f.sigma_east.median) && !std::isfinite(f.point_sigma_horizontal.median)) return "";
  const double s0 = result.degrees_of_freedom > 0 ? std::sqrt(std::max(0.0, result.variance_factor)) : kUnknown;
  const double scale = result.sigma_scaled ? 1 : s0;
  double most = 0;
  for (const Spread* s : {&f.sigma_east, &f.sigma_north, &f.sigma_up, &f.point_sigma_horizontal, &f.point_sigma_up})
    if (std::isfinite(s->p95)) most = std::max(most, s->p95);
  const LengthUnit unit = length_unit(most);
  Table table({"standard deviation", "median", "95 %", "largest", "median × σ₀"});
  const auto add = [&](const std::string& name, const Spread& s, double factor, int decimals) {
    if (!std::isfinite(s.median)) return;
    table.add({name, fixed(s.median * factor, decimals), fixed(s.p95 * factor, decimals),
               fixed(s.largest * factor, decimals), fixed(s.median * scale * factor, decimals)});
  };
  add(in_unit("frames, east", unit), f.sigma_east, unit.factor, unit.decimals);
  add(in_unit("frames, north", unit), f.sigma_north, unit.factor, unit.decimals);
  add(in_unit("frames, up", unit), f.sigma_up, unit.factor, unit.decimals);
  add("frames, rotation [°]", f.sigma_rotation, kDegrees, 4);
  add(in_unit("tie points, horizontal", unit), f.point_sigma_horizontal, unit.factor, unit.decimals);
  add(in_unit("tie points, up", unit), f.point_sigma_up, unit.factor, unit.decimals);
  return section(
      "accuracy", "Accuracy from the adjustment",
      paragraph(std::string("Standard deviations from the covariance of the whole block, ") +
                (result.sigma_scaled ? "multiplied by σ₀ a posteriori, as is the last column."
                                     : "a-priori variance factor 1; the last column multiplies by σ₀ a posteriori.") +
                " Rotation: the largest of the three axes.") +
          table.html("compact"));
}

}  // namespace megablock::report
