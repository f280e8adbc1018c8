// Writes the sections about the residuals of positions and attitudes, and about the accuracy of the result.
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>

#include "geometry/numbers/angles.h"
#include "geometry/numbers/median.h"
#include "io/block/held_priors.h"
#include "io/report/drawing/drawing.h"
#include "io/report/drawing/html.h"
#include "io/report/sections/sections.h"

namespace megablock::report {

namespace {

constexpr std::size_t kWorst = 5;  // number of listed residuals

void add_row(Table& table, const std::string& name, const Eigen::Vector3d& v, const LengthUnit& unit, bool sign) {
  std::vector<std::string> cells = {name};
  axes_cells(v, unit, sign, cells);
  table.add(std::move(cells));
}

// The rows with the largest components.
std::vector<std::size_t> largest_rows(const std::vector<Eigen::Vector3d>& values, std::size_t listed) {
  std::vector<std::size_t> order(values.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  const auto size = [&](std::size_t i) { return values[i].cwiseAbs().maxCoeff(); };
  listed = std::min(listed, order.size());
  std::partial_sort(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(listed), order.end(),
                    [&](std::size_t a, std::size_t b) { return std::pair(-size(a), a) < std::pair(-size(b), b); });
  order.resize(listed);
  return order;
}

// The residuals without those of held values, which are zero and say nothing.
template <typename Residual>
std::vector<Residual> not_held(const std::vector<Residual>& residuals, double held_sigma) {
  std::vector<Residual> rest;
  std::ranges::copy_if(residuals, std::back_inserter(rest),
                       [&](const Residual& r) { return r.sigma.minCoeff() > 2 * held_sigma; });
  return rest;
}

std::string but_held(std::size_t held) {
  return held > 0 ? fmt::format(" that is not held ({} more are held)", count(static_cast<std::int64_t>(held))) : "";
}

}  // namespace

std::string positions_section(const BlockResult& result, const Figures& f) {
  const std::vector<PositionResidual> positions = not_held(f.positions, kHeldPositionSigma);
  if (positions.empty()) return "";
  std::vector<Eigen::Vector3d> differences, sigmas, normalised;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero(), extreme = Eigen::Vector3d::Zero();
  for (const PositionResidual& r : positions) {
    differences.push_back(r.difference);
    sigmas.push_back(r.sigma);
    normalised.push_back(r.difference.cwiseQuotient(r.sigma));
    mean += r.difference / static_cast<double>(positions.size());
    extreme = extreme.cwiseMax(r.difference.cwiseAbs());
  }
  const Eigen::Vector3d rms = root_mean_square(differences), relative = root_mean_square(normalised);
  const LengthUnit unit = length_unit(largest(differences));
  Table table({in_unit("adjusted − GNSS", unit), "east", "north", "up"});
  add_row(table, "root mean square", rms, unit, false);
  add_row(table, "mean", mean, unit, true);
  add_row(table, "largest", extreme, unit, false);
  add_row(table, "stated sigma (rms)", root_mean_square(sigmas), unit, false);
  table.add({"rms of residual ÷ sigma", fixed(relative.x(), 2), fixed(relative.y(), 2), fixed(relative.z(), 2)});

  Table worst({"worst frames", in_unit("east", unit), in_unit("north", unit), in_unit("up", unit), "÷ sigma"});
  for (const std::size_t i : largest_rows(normalised, kWorst)) {
    const PositionResidual& r = positions[i];
    const double ratio = normalised[i].cwiseAbs().maxCoeff();
    std::vector<std::string> cells = {escape(result.block.frames[r.frame].name)};
    axes_cells(r.difference, unit, true, cells);
    cells.push_back(fixed(ratio, 1));
    worst.add(std::move(cells), ratio > kGrossRatio ? "look" : "");
  }
  std::string body = paragraph(fmt::format("{} of {} oriented frames carry a GNSS position{}. Lever arms are applied.",
                                           count(static_cast<std::int64_t>(positions.size())), count(f.oriented_frames),
                                           but_held(f.positions.size() - positions.size())));
  body += "<div class=row><div class=aside>" + table.html() + "</div><div class=aside>" + worst.html() + "</div>" +
          figure(draw_horizontal(positions), "Horizontal residuals.") +
          figure(draw_vertical(positions), "Vertical residuals, frame by frame.") + "</div>";
  return section("positions", "GNSS residuals", body);
}

std::string attitudes_section(const BlockResult& result, const Figures& f) {
  const std::vector<AttitudeResidual> attitudes = not_held(f.attitudes, kHeldAttitudeSigma);
  if (attitudes.empty()) return "";
  std::vector<Eigen::Vector3d> differences, sigmas, normalised;
  for (const AttitudeResidual& r : attitudes) {
    differences.push_back(r.difference * kDegreesPerRadian);
    sigmas.push_back(r.sigma * kDegreesPerRadian);
    normalised.push_back(r.difference.cwiseQuotient(r.sigma));
  }
  Eigen::Vector3d mean = Eigen::Vector3d::Zero(), extreme = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& d : differences) {
    mean += d / static_cast<double>(differences.size());
    extreme = extreme.cwiseMax(d.cwiseAbs());
  }
  const LengthUnit degrees{1, "°", 3};
  Table table({"adjusted − observed [°]", "about x", "about y", "about z"});
  add_row(table, "root mean square", root_mean_square(differences), degrees, false);
  add_row(table, "mean", mean, degrees, true);
  add_row(table, "largest", extreme, degrees, false);
  add_row(table, "stated sigma (rms)", root_mean_square(sigmas), degrees, false);
  add_row(table, "rms of residual ÷ sigma", root_mean_square(normalised), {1, "", 2}, false);
  Table worst({"worst frames", "about x [°]", "about y [°]", "about z [°]", "÷ sigma"});
  for (const std::size_t i : largest_rows(normalised, kWorst)) {
    std::vector<std::string> cells = {escape(result.block.frames[attitudes[i].frame].name)};
    axes_cells(differences[i], degrees, true, cells);
    const double ratio = normalised[i].cwiseAbs().maxCoeff();
    cells.push_back(fixed(ratio, 1));
    worst.add(std::move(cells), ratio > kGrossRatio ? "look" : "");
  }
  return section(
      "attitudes", "Attitude residuals",
      paragraph(fmt::format("{} of {} oriented frames carry observed angles{}. Rotation from the observed to the "
                            "adjusted attitude about the camera's or rig's axes: x right, y down, z forward.",
                            count(static_cast<std::int64_t>(attitudes.size())), count(f.oriented_frames),
                            but_held(f.attitudes.size() - attitudes.size()))) +
          "<div class=row><div class=aside>" + table.html() + "</div><div class=aside>" + worst.html() +
          "</div></div>");
}

namespace {

// The medians of the empirical sigmas of the oriented frames: east, north, up, rotation (largest axis); kUnknown where
// they were not computed.
std::array<double, 4> empirical_medians(const BlockResult& result) {
  std::array<std::vector<double>, 4> sigmas;
  const auto& covariances = result.empirical.frame_covariance;
  for (FrameIndex f(0); covariances.contains(f); ++f.value) {
    if (!result.state.oriented[f]) continue;
    const PoseIncrement sigma = covariances[f].diagonal().cwiseMax(0).cwiseSqrt();
    for (int k = 0; k < 3; ++k) sigmas[static_cast<std::size_t>(k)].push_back(sigma[3 + k]);
    sigmas[3].push_back(sigma.head<3>().maxCoeff());
  }
  std::array<double, 4> medians;
  for (std::size_t k = 0; k < 4; ++k) medians[k] = sigmas[k].empty() ? kUnknown : median(std::move(sigmas[k]));
  return medians;
}

std::string about_datum(const BlockResult& result) {
  if (!result.gauge.starts_with("free")) return "";
  return " The datum is free: these are the sigmas after the similarity that fits the poses of all images best.";
}

}  // namespace

std::string accuracy_section(const BlockResult& result, const Figures& f, const std::function<void()>& after_reading) {
  if (!std::isfinite(f.sigma_east.median) && !std::isfinite(f.point_sigma_horizontal.median)) return "";
  const double s0 = result.degrees_of_freedom > 0 ? std::sqrt(std::max(0.0, result.variance_factor)) : kUnknown;
  // Covariances are for sigma naught = 1, unless the job has scaled them.
  const double scale = result.sigma_scaled ? 1 : s0;
  double most = 0;
  for (const Spread* s : {&f.sigma_east, &f.sigma_north, &f.sigma_up, &f.point_sigma_horizontal, &f.point_sigma_up})
    if (std::isfinite(s->p95)) most = std::max(most, s->p95);
  const LengthUnit unit = length_unit(most, ground_unit(f));
  const std::array<double, 4> empirical = empirical_medians(result);
  const bool both = std::isfinite(empirical[0]);
  std::vector<std::string> headings{"formal sigma", "median", "95 %", "largest", "median × σ₀"};
  if (both) headings.push_back("empirical sigma, median");
  Table table(std::move(headings));
  const auto add = [&](const std::string& name, const Spread& s, double factor, double other = kUnknown) {
    if (!std::isfinite(s.median)) return;
    std::vector<std::string> cells{name, sigma_text(s.median * factor), sigma_text(s.p95 * factor),
                                   sigma_text(s.largest * factor), sigma_text(s.median * scale * factor)};
    if (both) cells.push_back(std::isfinite(other) ? sigma_text(other * factor) : "");
    table.add(std::move(cells));
  };
  add(in_unit("frames, east", unit), f.sigma_east, unit.factor, empirical[0]);
  add(in_unit("frames, north", unit), f.sigma_north, unit.factor, empirical[1]);
  add(in_unit("frames, up", unit), f.sigma_up, unit.factor, empirical[2]);
  add("frames, rotation [°]", f.sigma_rotation, kDegreesPerRadian, empirical[3]);
  add(in_unit("tie points, horizontal", unit), f.point_sigma_horizontal, unit.factor);
  add(in_unit("tie points, up", unit), f.point_sigma_up, unit.factor);
  return section(
      "accuracy", "Accuracy from the adjustment",
      paragraph(std::string("Standard deviations from the covariance of the whole block, ") +
                (result.sigma_scaled ? "all multiplied by σ₀ a posteriori."
                                     : "for σ₀ = 1; only those of the last column are multiplied by σ₀ a posteriori.") +
                " Rotation: the largest of the three axes." + about_datum(result) +
                (both ? " Empirical sigmas follow from the residuals of the tie points of each image, whose errors may "
                        "be alike; the formal ones take all observations as independent."
                      : "")) +
          table.html("compact") + ellipses_figure(result, f, after_reading));
}

}  // namespace megablock::report
