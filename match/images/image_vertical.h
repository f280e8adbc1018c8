// The vertical in one picture, from its straight edges (M45): segments, vanishing points, the one of the vertical.
// Nothing of any other picture is needed.
//
// A large picture is looked at reduced first, which takes a sixth of the time: what shows a vertical shows it there
// too, by fewer and longer edges (so did all of 79 pictures). Where not even an accident looks like one, no more is
// looked for.
#pragma once

#include <cstdint>
#include <string>

#include "geometry/vanishing/vertical.h"
#include "io/block/block.h"
#include "match/images/line_segments.h"

namespace megablock {

struct ImageVertical {
  std::string failure;                     // of reading the picture; one line
  int segments = 0, vanishing_points = 0;  // of the last look
  // Below, where there is a vertical.
  bool found = false;
  // Camera axes, pointing down. Its covariance is that of the lines times their variance factor, where that is above
  // one.
  AxisDirection down;
  double roll = 0;  // from where it was expected, in sigmas of the prior
  // Of `down` by each parameter of the camera: these turn and bend the lines of all its images together.
  Eigen::Matrix3Xd by_camera;
  int lines = 0;  // that show it
  double variance_factor = 0;
  double log10_nfa = 0;
};

// Never throws for a bad file. `camera`: of the picture, whose size it must have; its mask is honoured.
ImageVertical find_image_vertical(const std::string& path, const Camera& camera, const VerticalPrior& prior,
                                  std::uint64_t seed, const SegmentOptions& options = {});

}  // namespace megablock
