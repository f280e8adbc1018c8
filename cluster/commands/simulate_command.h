// The command `megablock simulate`.
#pragma once

#include <functional>

namespace CLI {
class App;
}

namespace megablock {

// A command fills this in when it was chosen; it is run after parsing, so that all errors leave by one door.
using Action = std::function<int()>;

void add_simulate(CLI::App& app, Action& action);

}  // namespace megablock
