#include "io/remarks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace megablock {

namespace {

constexpr std::size_t kNamed = 5;  // points by name

// Pixels from fractions to nonsense: 12.3, 4810, 1.4e6.
std::string pixels(double value) {
  if (value < 100) return fmt::format("{:.1f}", value);
  if (value < 1e5) return fmt::format("{:.0f}", value);
  const int power = static_cast<int>(std::floor(std::log10(value)));
  return fmt::format("{:.1f}e{}", value / std::pow(10, power), power);
}

}  // namespace

std::vector<UnusedPoint> unused_points(const BlockResult& result, PointRole role) {
  std::vector<UnusedPoint> unused;
  for (std::size_t p = 0; p < std::min(result.control.size(), result.block.control_points.size()); ++p) {
    const ControlPoint& given = result.block.control_points[p];
    const BlockResult::ControlResult& control = result.control[p];
    if (given.role != role) continue;
    UnusedPoint point{p, {}, 0};
    bool used = false;
    for (std::size_t m = 0; m < std::min(given.measurements.size(), control.residual_px.size()); ++m) {
      used = used || control.takes_part(m);
      const double length = control.residual_px[m].norm();
      if (std::isfinite(length) && (!point.image.valid() || length > point.worst_px))
        point = {p, given.measurements[m].image, length};
    }
    if (!used) unused.push_back(point);
  }
  std::stable_sort(unused.begin(), unused.end(), [](const auto& a, const auto& b) { return a.worst_px > b.worst_px; });
  return unused;
}

std::string unused_points_text(const BlockResult& result, PointRole role) {
  const std::vector<UnusedPoint> unused = unused_points(result, role);
  if (unused.empty()) return "";
  const bool one = unused.size() == 1;
  std::string text =
      fmt::format("{} {} {} take{} no part: ", unused.size(), role == PointRole::kCheck ? "check" : "control",
                  one ? "point" : "points", one ? "s" : "");
  for (std::size_t i = 0; i < std::min(kNamed, unused.size()); ++i) {
    const UnusedPoint& point = unused[i];
    text +=
        (i > 0 ? ", " : "") + result.block.control_points[point.point].name + " (" +
        (point.image.valid() ? pixels(point.worst_px) + " px in " + result.block.images[point.image].name + ", rejected"
                             : "not seen by an oriented image") +
        ")";
  }
  if (unused.size() > kNamed) text += fmt::format(" and {} more", unused.size() - kNamed);
  return text;
}

std::vector<std::string> remarks(const BlockResult& result) {
  std::vector<std::string> lines;
  for (const PointRole role : {PointRole::kControl, PointRole::kCheck})
    if (std::string text = unused_points_text(result, role); !text.empty()) lines.push_back(std::move(text));
  return lines;
}

}  // namespace megablock
