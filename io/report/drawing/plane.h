// Gives the plan view that the maps of the report share: its extent, its scale, and the places of frames in it.
//
// The drawing is a parallel projection along the vertical. With the middle (E0, N0) of the extent, the scale s and the
// drawing of W = kMapWidth times H = `height` units,
//
//     x = W / 2 + s (E - E0),    y = H / 2 - s (N - N0),
//
// because the y axis of SVG points down. s is the largest scale at which the extent fits inside the margins; it is the
// same for both axes, so that lengths and directions are right. H follows from the shape of the block, within limits.
// Internal to io/: it is not installed.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "io/evaluation/figures.h"

namespace megablock::report {

inline constexpr double kMapWidth = 1000;
inline constexpr double kMapFoot = 30;  // height of the strip below the map, for the scale bar

struct Plane {
  Eigen::Vector2d low = Eigen::Vector2d::Zero(), high = Eigen::Vector2d::Ones();  // metres
  double scale = 1, height = 320;                                                 // drawing units per metre
  Eigen::Vector2d at(const Eigen::Vector2d& ground) const;
  bool shows(const Eigen::Vector2d& drawn) const;
};
Plane plane_over(const std::vector<Eigen::Vector2d>& places);

// Selects the frames of one drawing.
using FrameSelection = std::function<bool(FrameIndex)>;

// Returns the plane that contains the selected frames that are oriented (or all selected frames if none is), their tie
// points without the outermost 2 % on each side, and, if wanted, the control points that they see. The tie points are
// needed because a facade lies beside the frames, not below them. Empty if nothing has a position. `after_reading` is
// that of ReportContext.
std::optional<Plane> plane_of(const BlockResult& result, const FrameSelection& selected, bool with_control,
                              const std::function<void()>& after_reading);

// Whether a tie point belongs to the selected frames. Its first image decides.
bool is_of(const BlockResult& result, std::size_t track, const FrameSelection& selected);

// The place where a frame is drawn: that of its pose, else its GNSS position.
std::optional<Eigen::Vector2d> place_of(const BlockResult& result, FrameIndex frame);

// The place where a control or check point is drawn: where the block sees it, else its coordinates. Wrong coordinates
// thus do not spoil the scale of the map.
std::optional<Eigen::Vector2d> place_of_control(const BlockResult& result, std::size_t row);

// The parts of a map around its contents. Lengths are in metres, or in the units of a part with an arbitrary scale.
std::string open_map(const Plane& plane, const std::string& label);
std::string coordinate_grid(const Plane& plane, const char* unit);
std::string scale_bar(const Plane& plane, const char* unit);
std::string north_arrow();

}  // namespace megablock::report
