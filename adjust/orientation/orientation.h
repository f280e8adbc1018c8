// Initial orientation of a connected component whose images carry no attitude:
// relative rotations -> robust rotation averaging -> global positioning (rays and GPS) -> triangulation -> coarse
// adjustment. Independent of image order.
#pragma once

#include <string>
#include <vector>

#include "adjust/orientation/steps/orientation_options.h"
#include "adjust/problem/tile_problem.h"
#include "io/block/features.h"
#include "io/project/inputs/verticals.h"

namespace megablock {

struct OrientationResult {
  BlockState state;                                        // `oriented` set for the frames that got a pose
  std::vector<std::pair<FrameIndex, std::string>> failed;  // frames without pose and why
  std::vector<SetAsideVertical> verticals_aside;           // that are not believed (vertical_check.h), by image
  std::string summary;                                     // one line
};

// Orients the frames of one component. Frames oriented in `start` (given poses) stay where they are and orient others.
// Without position priors the result is a free block: centroid at the origin, mean baseline one unit, first principal
// plane horizontal. `pairs` and `tracks` are those of the component.
OrientationResult orient_component(const Block& block, const BlockState& start, const std::vector<FrameIndex>& frames,
                                   const std::vector<VerifiedPair>& pairs, const TrackSet& tracks,
                                   const OrientationOptions& options);

}  // namespace megablock
