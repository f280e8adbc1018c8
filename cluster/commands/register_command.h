// Adds the commands `resect`, which gives poses of frames from control points, and `register`, which registers a
// trajectory.
#pragma once

#include <functional>

namespace CLI {
class App;
}

namespace megablock {

class Communicator;

void add_resect(CLI::App& app, std::function<int()>& action);
void add_register(CLI::App& app, std::function<int()>& action, Communicator& ranks);

}  // namespace megablock
