// Gives the frames of a connected component their initial poses from verified pairs and tracks. No attitudes are
// needed.
//
// The steps are rotation averaging, projection centres from baselines, alignment with observed positions, global
// positioning and three coarse adjustments. Verticals of images enter the rotations after a check (vertical_check.h).
// The result does not depend on the order of the images. Rotations are world -> frame, centres in metres where
// positions are observed.
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
  std::vector<std::pair<FrameIndex, std::string>> failed;  // frames without a pose, and the reason
  std::vector<SetAsideVertical> verticals_aside;           // rejected by vertical_check.h, by image
  std::string summary;                                     // one line
};

// Orients the frames of one component. Frames that are oriented in `start` keep their given poses and serve to orient
// the others. Without position priors the result is a free block (similarity_to_free_frame, ground_alignment.h).
// `pairs` and `tracks` are those of the component. Throws ComputeError when fewer than two frames can be oriented.
OrientationResult orient_component(const Block& block, const BlockState& start, const std::vector<FrameIndex>& frames,
                                   const std::vector<VerifiedPair>& pairs, const TrackSet& tracks,
                                   const OrientationOptions& options);

}  // namespace megablock
