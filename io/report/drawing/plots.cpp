// Draws the charts of the report: bars, residual fields, densities, GNSS residuals.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "io/report/drawing/drawing.h"
#include "io/report/drawing/html.h"
#include "io/text/counted.h"

namespace megablock::report {

namespace {

// Converts the coordinates of data to a drawing of fixed size with space for labels.
struct Axes {
  double x_low, x_high, y_low, y_high;
  double width = 480, height = 240, left = 58, right = 12, top = 12, bottom = 44;
  double x(double value) const { return left + (value - x_low) / (x_high - x_low) * (width - left - right); }
  double y(double value) const {
    return height - bottom - (value - y_low) / (y_high - y_low) * (height - top - bottom);
  }
};

std::string open(const Axes& axes, const std::string& label) {
  return fmt::format("<svg viewBox=\"0 0 {:.0f} {:.0f}\" role=img aria-label=\"{}\">", axes.width, axes.height, label);
}

std::string text(double x, double y, const char* anchor, const std::string& words, const char* style = "") {
  return fmt::format("<text x={:.1f} y={:.1f} text-anchor={}{}>{}</text>", x, y, anchor, style, words);
}

std::string line(double x1, double y1, double x2, double y2, const char* style) {
  return fmt::format("<line x1={:.1f} y1={:.1f} x2={:.1f} y2={:.1f} class={} />", x1, y1, x2, y2, style);
}

std::string titles(const Axes& a, const std::string& x, const std::string& y) {
  const double middle = (a.top + a.height - a.bottom) / 2;
  return text((a.left + a.width - a.right) / 2, a.height - 8, "middle", x, " class=title") +
         fmt::format("<text transform=\"translate(13 {:.1f}) rotate(-90)\" text-anchor=middle class=title>{}</text>",
                     middle, y);
}

// The number of decimals that the labels of a grid with this step need.
int decimals_of(double step) { return std::max(0, -static_cast<int>(std::floor(std::log10(step) + 1e-9))); }

// Draws the horizontal grid lines. The labels are the data times `factor`.
std::string horizontal_grid(const Axes& a, double factor = 1) {
  const double step = round_step((a.y_high - a.y_low) * factor, 5) / factor;
  const int decimals = decimals_of(step * factor);
  std::string svg;
  for (double v = std::ceil(a.y_low / step - 1e-9) * step; v <= a.y_high + 1e-9 * step; v += step) {
    svg += line(a.left, a.y(v), a.width - a.right, a.y(v), std::abs(v) < 1e-9 * step ? "axis" : "grid");
    const double shown = v * factor;
    svg += text(a.left - 6, a.y(v) + 4, "end",
                decimals == 0 && std::abs(shown) >= 1000 ? count(std::llround(shown)) : fixed(shown, decimals));
  }
  return svg;
}

// The space left of the axis for the title and for counts up to `most`, which have spaces between thousands.
double room_for_labels(std::int64_t most) {
  constexpr double kTitle = 26, kDigit = 6.8, kSpace = 3;
  const auto digits = static_cast<double>(std::to_string(most).size());
  return kTitle + kDigit * digits + kSpace * std::floor((digits - 1) / 3);
}

std::string vertical_grid(const Axes& a, double factor) {
  const double step = round_step((a.x_high - a.x_low) * factor, 7) / factor;
  const int decimals = decimals_of(step * factor);
  std::string svg;
  for (double v = std::ceil(a.x_low / step - 1e-9) * step; v <= a.x_high + 1e-9 * step; v += step) {
    svg += line(a.x(v), a.top, a.x(v), a.height - a.bottom, std::abs(v) < 1e-9 * step ? "axis" : "grid");
    svg += text(a.x(v), a.height - a.bottom + 16, "middle", fixed(v * factor, decimals));
  }
  return svg;
}

// The expected number per bin, n w phi(v / s) / s with n values, the bin width w and the normal density phi.
std::string bell(const BarChart& chart, const Axes& axes) {
  const Histogram& h = chart.histogram;
  const double area = static_cast<double>(h.total()) * h.width;
  const double s = chart.bell_sigma;
  std::string path;
  for (int i = 0; i <= 80; ++i) {
    const double v = axes.x_low + (axes.x_high - axes.x_low) * i / 80;
    const double density = area / (s * std::sqrt(2 * std::numbers::pi)) * std::exp(-0.5 * v * v / (s * s));
    path += fmt::format("{}{:.1f} {:.1f}", i ? "L" : "M", axes.x(v), axes.y(std::min(density, axes.y_high)));
  }
  return "<path d=\"" + path + "\" class=curve />";
}

std::string bin_labels(const BarChart& chart, const Axes& axes) {
  const Histogram& h = chart.histogram;
  const double step = std::max(h.width, round_step(axes.x_high - axes.x_low, 8));
  const double baseline = axes.height - axes.bottom + 16;
  std::string svg;
  if (chart.centred_labels) {
    for (std::size_t b = 0; b < h.bins.size(); ++b) {
      const double v = h.low + h.width * static_cast<double>(b);
      const bool last = b + 1 == h.bins.size() && chart.open_ended;
      svg += text(axes.x(v + h.width / 2), baseline, "middle", (last ? "≥" : "") + fixed(v, chart.decimals));
    }
    return svg;
  }
  for (double v = std::ceil(axes.x_low / step - 1e-9) * step; v <= axes.x_high + 1e-9 * step; v += step)
    svg += text(axes.x(v), baseline, "middle", fixed(v, chart.decimals));
  return svg;
}

}  // namespace

double round_step(double range, int parts) {
  if (!(range > 0) || !std::isfinite(range)) return 1;
  // The smallest of 1, 2, 5, 10 times a power of ten that is at least range / parts. 1e-9 absorbs rounding.
  const double raw = range / parts;
  const double power = std::pow(10, std::floor(std::log10(raw)));
  for (double factor : {1.0, 2.0, 5.0})
    if (factor * power >= raw * (1 - 1e-9)) return factor * power;
  return 10 * power;
}

double step_below(double value) {
  if (!(value > 0) || !std::isfinite(value)) return 1;
  const double power = std::pow(10, std::floor(std::log10(value) + 1e-9));
  for (double factor : {5.0, 2.0})
    if (factor * power <= value * (1 + 1e-9)) return factor * power;
  return power;
}

std::string exaggeration_text(double exaggeration) {
  const auto fold = [](double factor) {
    const std::int64_t n = std::llround(factor);
    return n == 2 ? "twofold" : n == 5 ? "fivefold" : n == 10 ? "tenfold" : count(n) + "-fold";
  };
  if (std::abs(exaggeration - 1) < 1e-9) return "drawn to scale";
  return exaggeration > 1 ? "exaggerated " + fold(exaggeration) : "reduced " + fold(1 / exaggeration);
}

std::string draw(const BarChart& chart) {
  const Histogram& h = chart.histogram;
  const std::int64_t most = h.bins.empty() ? 0 : *std::max_element(h.bins.begin(), h.bins.end());
  if (most == 0) return paragraph("Nothing to show.", "muted");
  Axes axes{h.low, h.low + h.width * static_cast<double>(h.bins.size()), 0, 1.06 * static_cast<double>(most)};
  axes.left = std::max(axes.left, room_for_labels(most));
  std::string svg = open(axes, escape(chart.x_title)) + horizontal_grid(axes);
  for (std::size_t b = 0; b < h.bins.size(); ++b) {
    if (h.bins[b] == 0) continue;
    const double low = h.low + h.width * static_cast<double>(b);
    const double left = axes.x(low) + 0.6, right = axes.x(low + h.width) - 0.6;
    const double top = axes.y(static_cast<double>(h.bins[b]));
    const bool open_bin = chart.open_ended && b + 1 == h.bins.size();
    const std::string range = chart.centred_labels
                                  ? (open_bin ? "≥ " : "") + fixed(low, chart.decimals)
                                  : fixed(low, chart.decimals + 1) +
                                        (open_bin ? " and more" : " to " + fixed(low + h.width, chart.decimals + 1));
    svg += fmt::format("<rect x={:.1f} y={:.1f} width={:.1f} height={:.1f} class=bar><title>{}: {}</title></rect>",
                       left, top, std::max(0.5, right - left), axes.y(0) - top, range, count(h.bins[b]));
  }
  if (chart.bell_sigma > 0) svg += bell(chart, axes);
  return svg + bin_labels(chart, axes) + titles(axes, chart.x_title, chart.y_title) + "</svg>";
}

namespace {

// Joins two by two cells into one.
ResidualField coarser(const ResidualField& fine) {
  ResidualField field;
  field.columns = (fine.columns + 1) / 2;
  field.rows = (fine.rows + 1) / 2;
  field.squares = fine.squares;
  field.observations = fine.observations;
  field.sum.assign(static_cast<std::size_t>(field.columns * field.rows), Eigen::Vector2d::Zero());
  field.count.assign(field.sum.size(), 0);
  for (int r = 0; r < fine.rows; ++r)
    for (int c = 0; c < fine.columns; ++c) {
      const auto from = static_cast<std::size_t>(r * fine.columns + c);
      const auto to = static_cast<std::size_t>(r / 2 * field.columns + c / 2);
      field.sum[to] += fine.sum[from];
      field.count[to] += fine.count[from];
    }
  return field;
}

}  // namespace

// The largest factor by which an arrow `d` from `foot` may be lengthened and still end inside the frame.
double room_in_frame(const Eigen::Vector2d& foot, const Eigen::Vector2d& d, const Eigen::Vector2d& frame) {
  double room = std::numeric_limits<double>::infinity();
  for (int k = 0; k < 2; ++k)
    if (d[k] != 0) room = std::min(room, (d[k] > 0 ? frame[k] - foot[k] : foot[k]) / std::abs(d[k]));
  return room;
}

FieldDrawing draw(const ResidualField& fine, const Camera& camera) {
  constexpr double width = 480;
  constexpr std::int64_t enough = 40;  // mean number of observations per cell, so that its mean exceeds the noise
  const bool sparse = fine.observations < enough * fine.columns * fine.rows && fine.columns > 2 && fine.rows > 2;
  const ResidualField field = sparse ? coarser(fine) : fine;
  constexpr std::int64_t few = 3;  // a cell with fewer observations has no useful mean
  const double scale = width / camera.width, height = camera.height * scale;
  const double cell_width = width / field.columns, cell_height = height / field.rows;
  const auto foot_of = [&](int r, int c) { return Eigen::Vector2d((c + 0.5) * cell_width, (r + 0.5) * cell_height); };
  std::vector<double> lengths;
  std::vector<double> rooms;  // for each arrow, the exaggeration at which it just stays inside
  std::int64_t most = 1;
  for (int r = 0; r < field.rows; ++r)
    for (int c = 0; c < field.columns; ++c) {
      const std::int64_t n = field.count[static_cast<std::size_t>(r * field.columns + c)];
      most = std::max(most, n);
      if (n < few) continue;
      lengths.push_back(field.mean(r, c).norm());
      rooms.push_back(room_in_frame(foot_of(r, c), field.mean(r, c) * scale, {width, height}));
    }
  // An arrow of the 95 % quantile is as long as a cell, or shorter, so that nearly all arrows end inside the frame.
  // Single long arrows must not make the others invisible. The exaggeration is rounded to a simple number.
  const double typical = spread(lengths).p95;
  const double cell_long = typical > 0 ? cell_width / (typical * scale) : 1;
  std::sort(rooms.begin(), rooms.end());
  const double room = rooms.empty() ? cell_long : rooms[rooms.size() / 50];  // 2 % of the arrows may be cut short
  const double wanted = std::clamp(room, 0.25 * cell_long, cell_long);
  const double exaggeration = step_below(wanted);
  std::string shades, arrows, feet;
  std::int64_t cut = 0;
  for (int r = 0; r < field.rows; ++r)
    for (int c = 0; c < field.columns; ++c) {
      const std::int64_t n = field.count[static_cast<std::size_t>(r * field.columns + c)];
      if (n == 0) continue;
      const double x = c * cell_width, y = r * cell_height;
      const Eigen::Vector2d mean = field.mean(r, c);
      shades += fmt::format(
          "<rect x={:.1f} y={:.1f} width={:.1f} height={:.1f} class=shade fill-opacity={:.2f}><title>{} observations, "
          "mean "
          "{} / {} px</title></rect>",
          x, y, cell_width, cell_height, 0.05 + 0.3 * std::sqrt(static_cast<double>(n) / static_cast<double>(most)),
          count(n), with_sign(mean.x(), 2), with_sign(mean.y(), 2));
      if (n < few) continue;
      const Eigen::Vector2d foot = foot_of(r, c);
      Eigen::Vector2d d = mean * scale * exaggeration;
      // A longer arrow would hide its neighbours.
      const double allowed = std::min(1.5 * cell_width / d.norm(), room_in_frame(foot, d, {width, height}));
      if (allowed < 1) d *= allowed, ++cut;
      feet += fmt::format("M{:.1f} {:.1f}h0", foot.x(), foot.y());
      arrows += fmt::format("M{:.1f} {:.1f}l{:.1f} {:.1f}", foot.x(), foot.y(), d.x(), d.y());
    }
  // The bar below the drawing shows a round number of pixels at the scale of the arrows.
  const double reference = round_step(cell_width / scale / exaggeration, 1);
  const double bar = reference * scale * exaggeration;
  FieldDrawing result;
  result.svg = fmt::format("<svg viewBox=\"-1 -1 {:.0f} {:.0f}\" role=img aria-label=\"Residual field\">", width + 2,
                           height + 26) +
               fmt::format("<rect width={:.0f} height={:.1f} class=frame />", width, height) + shades + "<path d=\"" +
               arrows + "\" class=arrow /><path d=\"" + feet + "\" class=foot />" +
               fmt::format("<rect x=-1 y={:.1f} width={:.0f} height=26 class=strip />", height + 1, width + 2) +
               fmt::format("<path d=\"M4 {0:.1f}h{1:.1f}\" class=arrow />", height + 15, bar) +
               text(bar + 12, height + 19, "start", significant(reference, 2) + " px in the image") + "</svg>";
  result.caption = fmt::format(
      "Mean residual (adjusted − measured) per part of the sensor, from the dot, {}{}; darker = more "
      "observations (up to {} a part). Single residuals: {} px rms.",
      exaggeration_text(exaggeration), cut > 0 ? fmt::format(", {} cut short", counted(cut, "arrow")) : "", count(most),
      field.observations ? fixed(std::sqrt(field.squares / static_cast<double>(field.observations)), 3) : kMissing);
  return result;
}

std::string draw_density(const ResidualField& field, const Camera& camera) {
  constexpr double width = 480;
  const double height = camera.height * width / camera.width;
  const double cell_width = width / field.columns, cell_height = height / field.rows;
  const std::int64_t most = std::max<std::int64_t>(1, *std::max_element(field.count.begin(), field.count.end()));
  std::string svg = fmt::format("<svg viewBox=\"-1 -1 {:.0f} {:.0f}\" role=img aria-label=\"Coverage of the sensor\">",
                                width + 2, height + 2) +
                    fmt::format("<rect width={:.0f} height={:.1f} class=frame />", width, height);
  for (int r = 0; r < field.rows; ++r)
    for (int c = 0; c < field.columns; ++c) {
      const std::int64_t n = field.count[static_cast<std::size_t>(r * field.columns + c)];
      if (n == 0) continue;
      svg += fmt::format(
          "<rect x={:.1f} y={:.1f} width={:.1f} height={:.1f} class=shade fill-opacity={:.2f}><title>{} "
          "measurements</title></rect>",
          c * cell_width, r * cell_height, cell_width, cell_height,
          0.15 + 0.85 * std::sqrt(static_cast<double>(n) / static_cast<double>(most)), count(n));
    }
  return svg + fmt::format("<path d=\"M{:.1f} 0V{:.1f}M0 {:.1f}H{:.1f}\" class=axis /></svg>", width / 2, height,
                           height / 2, width);
}

std::string draw_horizontal(const std::vector<PositionResidual>& residuals) {
  std::vector<double> sizes;
  for (const PositionResidual& r : residuals) sizes.push_back(r.difference.head<2>().cwiseAbs().maxCoeff());
  const Spread size = spread(sizes);
  // One outlier must not make the others invisible. Marks beyond three times the 95 % quantile are drawn at the border.
  const double reach = 1.1 * std::max(1e-4, std::min(size.largest, 3 * size.p95));
  Axes axes{-reach, reach, -reach, reach};
  axes.height = 340;
  const double aspect = (axes.width - axes.left - axes.right) / (axes.height - axes.top - axes.bottom);
  axes.x_low *= aspect;  // both axes have the same scale
  axes.x_high *= aspect;
  const LengthUnit unit = length_unit(reach);
  std::string svg =
      open(axes, "Horizontal GNSS residuals") + horizontal_grid(axes, unit.factor) + vertical_grid(axes, unit.factor);
  const std::size_t step = 1 + residuals.size() / 4000;
  for (std::size_t i = 0; i < residuals.size(); i += step) {
    const Eigen::Vector2d d = residuals[i].difference.head<2>();
    const bool outside = d.cwiseAbs().maxCoeff() > reach;
    svg += fmt::format("<circle cx={:.1f} cy={:.1f} r=2.6 class={} />", axes.x(std::clamp(d.x(), -reach, reach)),
                       axes.y(std::clamp(d.y(), -reach, reach)), outside ? "out" : "dot");
  }
  return svg + titles(axes, fmt::format("east [{}]", unit.name), fmt::format("north [{}]", unit.name)) + "</svg>";
}

std::string draw_vertical(const std::vector<PositionResidual>& residuals) {
  std::vector<double> sizes;
  for (const PositionResidual& r : residuals) sizes.push_back(std::abs(r.difference.z()));
  const Spread size = spread(sizes);
  const double reach = 1.1 * std::max(1e-4, std::min(size.largest, 3 * size.p95));
  Axes axes{-0.5, std::max(1.0, static_cast<double>(residuals.size())) - 0.5, -reach, reach};
  axes.height = 340;
  const LengthUnit unit = length_unit(reach);
  std::string svg = open(axes, "Vertical GNSS residuals") + horizontal_grid(axes, unit.factor), stems;
  const std::size_t step = 1 + residuals.size() / 4000;
  for (std::size_t i = 0; i < residuals.size(); i += step) {
    const double d = residuals[i].difference.z();
    const double x = axes.x(static_cast<double>(i)), y = axes.y(std::clamp(d, -reach, reach));
    if (residuals.size() <= 400) stems += fmt::format("M{:.1f} {:.1f}V{:.1f}", x, axes.y(0), y);
    svg += fmt::format("<circle cx={:.1f} cy={:.1f} r=2.2 class={} />", x, y, std::abs(d) > reach ? "out" : "dot");
  }
  return svg + "<path d=\"" + stems + "\" class=stem />" +
         titles(axes, "frames in block order", fmt::format("up [{}]", unit.name)) + "</svg>";
}

}  // namespace megablock::report
