// The command 'masks': proposals of masks from what never changes over the images of a camera (CN-10).
#pragma once

#include <functional>

namespace CLI {
class App;
}

namespace megablock {

void add_masks(CLI::App& app, std::function<int()>& action);

}  // namespace megablock
