// The command 'verticals': where down is in every picture, from its straight edges (M44, M45).
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

// Where down should be: by the attitude of the frame, else by its given pose, else by how the camera was held (EXIF).
VerticalPrior expected_vertical(const Block& block, ImageIndex image);

// What is said of verticals of which most lie where no camera is held; else empty.
std::string remark_on(const std::vector<PictureVertical>& pictures);

void add_verticals(CLI::App& app, std::function<int()>& action);

}  // namespace megablock
