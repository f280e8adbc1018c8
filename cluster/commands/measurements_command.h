// The command 'measurements': the measurements of tie points in some images, or about a place (CN-16).
#pragma once

#include <functional>

namespace CLI {
class App;
}

namespace megablock {

void add_measurements(CLI::App& app, std::function<int()>& action);

}  // namespace megablock
