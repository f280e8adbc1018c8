// Initial orientation of a connected component whose images carry no attitude:
// relative rotations -> robust rotation averaging -> global positioning (rays and GPS) -> triangulation -> coarse
// adjustment. Independent of image order.
#pragma once

#include <string>
#include <vector>

#include "adjust/tile_problem.h"
#include "io/features.h"
#include "io/verticals.h"

namespace megablock {

struct OrientationOptions {
  ObservationOptions observations;
  double max_rotation_error_deg = 10;  // relative rotations farther from the average are dropped
  int min_points_per_image = 15;       // an image with fewer triangulated points is not oriented
  std::int64_t tracks_per_pair = 120;  // longest tracks used for positioning (bounds memory)
  int part_frames = 0;                 // larger components without any position are oriented in parts of so many frames
                                       // (orientation_parts.h); 0: always as a whole
  void check() const;                  // throws InputError
};

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
