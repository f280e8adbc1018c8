// Gives the rays of the marks of a control point in the oriented images, and intersects them.
#pragma once

#include <optional>
#include <vector>

#include "geometry/intersection/triangulation.h"
#include "io/block/block.h"

namespace megablock {

// Marks of a point meet within this distance in the first orientation, which is bent by some pixels.
inline constexpr double kControlMark_px = 10;

struct SeenMarks {
  std::vector<PointView> marks;          // in oriented images of the frames; sigma 1 px
  std::optional<Eigen::Vector3d> place;  // in the frame of the state, where two marks or more agree
};

// `frames` ascend. The views refer to cameras of `state`.
SeenMarks see_marks(const Block& block, const BlockState& state, const std::vector<FrameIndex>& frames,
                    const ControlPoint& point);

}  // namespace megablock
