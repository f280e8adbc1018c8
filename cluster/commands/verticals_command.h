// The command `verticals` finds the vertical of every image from its straight edges (Kalantari 2009).
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "cluster/commands/found_verticals.h"
#include "geometry/vanishing/vertical.h"
#include "io/block/block.h"

namespace CLI {
class App;
}

namespace megablock {

// The expected direction of down: from the attitude of the frame, else from its given pose, else from the orientation
// in the EXIF header.
VerticalPrior expected_vertical(const Block& block, ImageIndex image);

// Returns a warning when most verticals lie in directions in which no camera is held; otherwise an empty text.
std::string remark_on(const std::vector<FoundVertical>& verticals);

void add_verticals(CLI::App& app, std::function<int()>& action);

}  // namespace megablock
