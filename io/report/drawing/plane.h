// The ground seen from above as the report's maps draw it.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "io/evaluation/figures.h"

namespace megablock::report {

inline constexpr double kMapWidth = 1000;
inline constexpr double kMapFoot = 30;  // strip below the map for the scale

struct Plane {
  Eigen::Vector2d low = Eigen::Vector2d::Zero(), high = Eigen::Vector2d::Ones();  // metres
  double scale = 1, height = 320;                                                 // drawing units per metre
  Eigen::Vector2d at(const Eigen::Vector2d& ground) const;
  bool shows(const Eigen::Vector2d& drawn) const;
};
Plane plane_over(const std::vector<Eigen::Vector2d>& places);

// The frames of one drawing.
using FrameSelection = std::function<bool(FrameIndex)>;

// Over the selected frames that are oriented (all, when none is), their tie points but for the outermost 2 % on each
// side (a facade lies beside the frames, not under them), and the control points with a place, if wanted. Empty when
// nothing has a place. `after_reading` as in ReportContext.
std::optional<Plane> plane_of(const BlockResult& result, const FrameSelection& selected, bool with_control,
                              const std::function<void()>& after_reading);

// A tie point of the selected frames: its first image tells.
bool is_of(const BlockResult& result, std::size_t track, const FrameSelection& selected);

// Where a frame is drawn: its pose, else its GNSS position.
std::optional<Eigen::Vector2d> place_of(const BlockResult& result, FrameIndex frame);

// What a drawing's lengths are in: metres, or the units of a part whose scale is its own.
std::string open_map(const Plane& plane, const std::string& label);
std::string coordinate_grid(const Plane& plane, const char* unit);
std::string scale_bar(const Plane& plane, const char* unit);
std::string north_arrow();

}  // namespace megablock::report
