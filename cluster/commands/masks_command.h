// The command `masks` proposes a mask for each camera. It masks the parts of its images that never change, such as the
// vehicle (Cannelle 2013).
#pragma once

#include <functional>

namespace CLI {
class App;
}

namespace megablock {

void add_masks(CLI::App& app, std::function<int()>& action);

}  // namespace megablock
