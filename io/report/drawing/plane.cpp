#include "io/report/drawing/plane.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "io/report/drawing/drawing.h"
#include "io/report/drawing/html.h"

namespace megablock::report {

namespace {

constexpr double kMostHeight = 900, kLeastHeight = 320, kMargin = 40;
constexpr int kGridLines = 8;                   // largest number along the longer side
constexpr double kOutermost = 0.02;             // share of the tie points that is left out on each side
constexpr std::size_t kFramingPoints = 100000;  // at most so many tie points determine the extent

// The corners of the area in which the tie points of the selected frames lie.
std::vector<Eigen::Vector2d> corners_of_tie_points(const BlockResult& result, const FrameSelection& selected,
                                                   const std::function<void()>& after_reading) {
  std::array<std::vector<double>, 2> values;
  const std::size_t step = 1 + result.points.size() / kFramingPoints;
  for (std::size_t t = 0; t < result.points.size(); t += step) {
    if (t / step % kTracksAtATime == 0) after_reading();
    if (!result.points[t].allFinite() || !is_of(result, t, selected)) continue;
    for (int k = 0; k < 2; ++k) values[static_cast<std::size_t>(k)].push_back(result.points[t][k]);
  }
  if (values[0].empty()) return {};
  Eigen::Vector2d low, high;
  for (int k = 0; k < 2; ++k) {
    std::vector<double>& axis = values[static_cast<std::size_t>(k)];
    std::sort(axis.begin(), axis.end());
    const auto out = static_cast<std::size_t>(kOutermost * static_cast<double>(axis.size()));
    low[k] = axis[out];
    high[k] = axis[axis.size() - 1 - out];
  }
  return {low, high};
}

bool is_seen(const BlockResult& result, std::size_t row) {
  return row < result.control.size() && result.control[row].adjusted.allFinite();
}

}  // namespace

Eigen::Vector2d Plane::at(const Eigen::Vector2d& ground) const {
  const Eigen::Vector2d middle = (low + high) / 2;
  return {kMapWidth / 2 + (ground.x() - middle.x()) * scale, height / 2 - (ground.y() - middle.y()) * scale};
}

bool Plane::shows(const Eigen::Vector2d& drawn) const {
  return drawn.x() >= 0 && drawn.x() <= kMapWidth && drawn.y() >= 0 && drawn.y() <= height;
}

Plane plane_over(const std::vector<Eigen::Vector2d>& places) {
  Plane plane;
  if (places.empty()) return plane;
  plane.low = plane.high = places.front();
  for (const Eigen::Vector2d& p : places) {
    plane.low = plane.low.cwiseMin(p);
    plane.high = plane.high.cwiseMax(p);
  }
  // A single place has no extent; one millimetre keeps the scale finite.
  const Eigen::Vector2d size = (plane.high - plane.low).cwiseMax(1e-3);
  plane.height = std::clamp(2 * kMargin + (kMapWidth - 2 * kMargin) * size.y() / size.x(), kLeastHeight, kMostHeight);
  plane.scale = std::min((kMapWidth - 2 * kMargin) / size.x(), (plane.height - 2 * kMargin) / size.y());
  return plane;
}

bool is_of(const BlockResult& result, std::size_t track, const FrameSelection& selected) {
  if (track + 1 >= result.tracks.begin.size() || result.tracks.begin[track] == result.tracks.begin[track + 1])
    return false;
  const ImageIndex image = result.tracks.image[static_cast<std::size_t>(result.tracks.begin[track])];
  return selected(result.block.images[image].frame);
}

std::optional<Eigen::Vector2d> place_of_control(const BlockResult& result, std::size_t row) {
  const Eigen::Vector2d place = is_seen(result, row) ? result.control[row].adjusted.head<2>()
                                                     : result.block.control_points[row].position.head<2>();
  return place.allFinite() ? std::optional(place) : std::nullopt;
}

std::optional<Eigen::Vector2d> place_of(const BlockResult& result, FrameIndex frame) {
  if (oriented(result, frame)) return result.state.frames[frame].centre.head<2>();
  if (const auto& prior = result.block.frames[frame].position_prior) return prior->position.head<2>();
  return std::nullopt;
}

std::optional<Plane> plane_of(const BlockResult& result, const FrameSelection& selected, bool with_control,
                              const std::function<void()>& after_reading) {
  std::vector<Eigen::Vector2d> with_pose, all;
  for (FrameIndex f(0); result.block.frames.contains(f); ++f.value) {
    if (!selected(f)) continue;
    const auto place = place_of(result, f);
    if (!place || !place->allFinite()) continue;
    all.push_back(*place);
    if (oriented(result, f)) with_pose.push_back(*place);
  }
  std::vector<Eigen::Vector2d>& shown = with_pose.empty() ? all : with_pose;
  // A point that no image sees may lie far away, as in the control list of a whole city.
  for (std::size_t row = 0; with_control && row < result.block.control_points.size(); ++row)
    if (const auto place = place_of_control(result, row); place && (shown.empty() || is_seen(result, row)))
      shown.push_back(*place);
  if (shown.empty()) return std::nullopt;
  for (const Eigen::Vector2d& corner : corners_of_tie_points(result, selected, after_reading)) shown.push_back(corner);
  return plane_over(shown);
}

std::string open_map(const Plane& plane, const std::string& label) {
  const double height = plane.height + kMapFoot;
  return fmt::format(
      "<svg class=map viewBox=\"0 0 {0:.0f} {1:.0f}\" role=img aria-label=\"{2}\">"
      "<rect width={0:.0f} height={1:.0f} class=frame />",
      kMapWidth, height, label);
}

// Draws lines of round coordinates, with labels of east at the top and of north at the left.
std::string coordinate_grid(const Plane& plane, const char* unit) {
  const Eigen::Vector2d middle = (plane.low + plane.high) / 2;
  // Half of what the drawing shows, in metres; more than the extent of the block.
  const Eigen::Vector2d half = Eigen::Vector2d(kMapWidth, plane.height) / (2 * plane.scale);
  const double step = round_step(2 * half.maxCoeff(), kGridLines);
  // 1e-9 keeps a step of 0.1 from becoming 0.0999..., which would get a second decimal.
  const int decimals = std::max(0, -static_cast<int>(std::floor(std::log10(step) + 1e-9)));
  const auto label = [&](double v) { return decimals > 0 ? fixed(v, decimals) : count(std::llround(v)); };
  std::string lines, texts;
  for (double v = std::ceil((middle.x() - half.x()) / step) * step; v <= middle.x() + half.x(); v += step) {
    const double x = plane.at({v, 0}).x();
    lines += fmt::format("M{:.1f} 0V{:.1f}", x, plane.height);
    if (x > 70 && x < kMapWidth - 70)
      texts += fmt::format("<text x={:.1f} y=12 text-anchor=middle>{}</text>", x, label(v));
  }
  for (double v = std::ceil((middle.y() - half.y()) / step) * step; v <= middle.y() + half.y(); v += step) {
    const double y = plane.at({0, v}).y();
    lines += fmt::format("M0 {:.1f}H{:.0f}", y, kMapWidth);
    if (y > 24 && y < plane.height - 8) texts += fmt::format("<text x=4 y={:.1f}>{}</text>", y - 3, label(v));
  }
  return "<path class=meridian d=\"" + lines + "\"/><g class=coordinate>" + texts +
         fmt::format("<text x=4 y=12>E, N [{}]</text></g>", unit);
}

std::string scale_bar(const Plane& plane, const char* unit) {
  // A round length of about a fifth of the block.
  const double length = round_step((plane.high - plane.low).maxCoeff() / 5, 1);
  const double drawn = length * plane.scale, y = plane.height + kMapFoot - 14;
  const bool kilometres = length >= 1000 && std::string(unit) == "m";
  const std::string label = kilometres ? significant(length / 1000, 2) + " km" : significant(length, 2) + " " + unit;
  return fmt::format(
      // A strip below the map covers everything that is drawn there, so nothing lies under the scale bar.
      "<rect x=1 y={:.1f} width={:.0f} height={:.0f} class=strip /><g class=scale><rect x=8 y={:.1f} width={:.1f} "
      "height=26 rx=4 />"
      "<path d=\"M16 {:.1f}v-6m0 3h{:.1f}m0 3v-6\"/><text x={:.1f} y={:.1f}>{}</text></g>",
      plane.height, kMapWidth - 2, kMapFoot - 1, y - 16, drawn + 90, y, drawn, drawn + 24, y + 2, label);
}

std::string north_arrow() {
  return fmt::format(
      "<g class=scale transform=\"translate({:.0f} 40)\"><path class=needle d=\"M0 -22l7 24l-7 -5l-7 5z\"/>"
      "<text y=18 text-anchor=middle>N</text></g>",
      kMapWidth - 24);
}

}  // namespace megablock::report
