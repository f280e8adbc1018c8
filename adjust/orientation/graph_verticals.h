// The verticals of the images of an orientation graph, for averaging its rotations and for judging the verticals
// (vertical_check.h).
// Internal to adjust/: it is not installed.
#pragma once

#include <optional>
#include <vector>

#include "adjust/orientation/steps/ground_alignment.h"
#include "adjust/orientation/steps/rotation_averaging.h"
#include "adjust/orientation/vertical_check.h"

namespace megablock {

// The verticals in the axes of the frames. Their sigmas include the errors of the cameras, because rotation averaging
// does not estimate these.
std::vector<KnownVertical> known_verticals(const Block& block, const OrientationGraph& graph,
                                           const OrientationValues& values);

struct SeenVerticals {
  std::vector<SeenDown> seen;       // in the axes of the frames
  std::vector<std::size_t> images;  // [seen] row of OrientationGraph::images
};
SeenVerticals seen_verticals(const Block& block, const OrientationGraph& graph, const OrientationValues& values);

// The direction of down in the axes of the averaged rotations, if attitudes or positions determine it. `angles`: what
// is known of these axes.
std::optional<AxisDirection> known_down(const Block& block, const OrientationGraph& graph,
                                        const OrientationValues& values, GroundAngles angles);

}  // namespace megablock
