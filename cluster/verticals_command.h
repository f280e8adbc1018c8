// The command 'verticals': where down is in every picture, from its straight edges (M44, M45).
#pragma once

#include <functional>

namespace CLI {
class App;
}

namespace megablock {

void add_verticals(CLI::App& app, std::function<int()>& action);

}  // namespace megablock
