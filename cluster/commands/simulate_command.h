// The command `simulate` makes a block with known truth.
#pragma once

#include <functional>

namespace CLI {
class App;
}

namespace megablock {

// The action of the command that was chosen. It runs after parsing, so that command_line() handles all errors.
using Action = std::function<int()>;

void add_simulate(CLI::App& app, Action& action);

}  // namespace megablock
