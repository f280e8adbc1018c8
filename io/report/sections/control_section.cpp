// Writes the section about control and check points and their image measurements.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "io/report/drawing/html.h"
#include "io/report/sections/sections.h"

namespace megablock::report {

namespace {

constexpr std::size_t kListedPoints = 200;        // largest number of listed points of each role
constexpr std::size_t kListedMeasurements = 400;  // largest number of listed measurements, worst first

const char* name_of(PointRole role) { return role == PointRole::kCheck ? "check" : "control"; }

void add_point(const ControlPoint& point, const PointResidual& r, const LengthUnit& unit, Table& table) {
  std::vector<std::string> cells = {escape(point.name), name_of(point.role)};
  axes_cells(r.difference, unit, true, cells);
  sigma_cells(r.sigma, unit, cells);
  cells.push_back(fixed(r.ratio, 1));
  cells.push_back(fmt::format("{} of {}", r.images, point.measurements.size()));
  cells.push_back(fixed(r.rms_px, 2));
  table.add(std::move(cells), r.ratio > kGrossRatio || r.images == 0 ? "bad"
                              : r.difference.head<2>().allFinite()   ? ""
                                                                     : "muted");
}

void add_points(const BlockResult& result, const Figures& f, PointRole role, const LengthUnit& unit, Table& table) {
  std::vector<Eigen::Vector3d> differences, ratios;
  double squares = 0;
  std::int64_t images = 0, points = 0;
  for (const PointResidual& r : f.points) {
    const ControlPoint& point = result.block.control_points[r.point];
    if (point.role != role) continue;
    differences.push_back(r.difference);
    ratios.push_back(Eigen::Vector3d(r.difference.cwiseQuotient(r.sigma)));
    // The mean of squares over all measurements, not over points.
    if (r.images) squares += r.rms_px * r.rms_px * r.images;
    images += r.images;
    if (static_cast<std::size_t>(++points) <= kListedPoints) add_point(point, r, unit, table);
  }
  if (points == 0) return;
  std::vector<std::string> cells = {fmt::format("rms of {}", count(points)), name_of(role)};
  axes_cells(root_mean_square(differences), unit, false, cells);
  cells.insert(cells.end(), {"", "", "", "", count(images),
                             fixed(images ? std::sqrt(squares / static_cast<double>(images)) : kUnknown, 2)});
  table.add(std::move(cells), "sum");
  const Eigen::Vector3d normalised = root_mean_square(ratios);
  table.add({"rms of difference ÷ sigma", name_of(role), fixed(normalised.x(), 2), fixed(normalised.y(), 2),
             fixed(normalised.z(), 2), "", "", "", "", "", ""},
            "sum");
}

std::string measurements_table(const BlockResult& result, const Figures& f) {
  if (f.measurements.empty()) return "";
  Table table({"point", "role", "image", "x [px]", "y [px]", "length [px]", "sigma [px]", "÷ sigma"}, 3);
  std::int64_t beyond = 0;
  for (const MeasurementResidual& r : f.measurements) beyond += r.ratio > kGrossRatio;
  for (std::size_t i = 0; i < std::min(kListedMeasurements, f.measurements.size()); ++i) {
    const MeasurementResidual& r = f.measurements[i];
    const ControlPoint& point = result.block.control_points[r.point];
    const ImageMeasurement& measurement = point.measurements[r.measurement];
    table.add({escape(point.name), name_of(point.role), escape(result.block.name_of(measurement.image)),
               with_sign(r.residual.x(), 2), with_sign(r.residual.y(), 2), fixed(r.residual.norm(), 2),
               fixed(measurement.sigma_px, 2), fixed(r.ratio, 1)},
              r.ratio > kGrossRatio ? "bad" : "");
  }
  const std::string summary =
      fmt::format("{} image measurements, {} beyond {} sigma", count(static_cast<std::int64_t>(f.measurements.size())),
                  count(beyond), fixed(kGrossRatio, 0));
  return details(summary, "<div class=tall>" + table.html("sortable small") + "</div>" +
                              more(f.measurements.size(), kListedMeasurements));
}

}  // namespace

std::string control_section(const BlockResult& result, const Figures& f) {
  if (f.points.empty()) return "";
  std::vector<Eigen::Vector3d> differences;
  for (const PointResidual& r : f.points) differences.push_back(r.difference);
  const LengthUnit unit = length_unit(largest(differences));
  Table table({"point", "role", in_unit("ΔE", unit), in_unit("ΔN", unit), in_unit("ΔU", unit), in_unit("σΔE", unit),
               in_unit("σΔN", unit), in_unit("σΔU", unit), "largest ÷ σ", "images", "rms [px]"},
              2);
  add_points(result, f, PointRole::kControl, unit, table);
  add_points(result, f, PointRole::kCheck, unit, table);
  return section("control", "Control and check points",
                 paragraph(fmt::format(
                     "Differences are adjusted − given. Their variance is the sum of the adjusted and the given "
                     "variance for a check point, and the given minus the adjusted variance for a control point, which "
                     "took part. Images: number of measurements that take part, of all. Marked are rows beyond {} "
                     "sigma, and points without any measurement that takes part: these keep their given position.",
                     fixed(kGrossRatio, 0))) +
                     table.html("sortable") + measurements_table(result, f));
}

}  // namespace megablock::report
