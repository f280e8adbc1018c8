// The commands `resect` (poses of frames from control points) and `register` (registration of a trajectory).
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
