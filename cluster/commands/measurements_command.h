// The command `measurements` lists the tie point observations in some images or near a place (Cannelle 2013).
#pragma once

#include <functional>

namespace CLI {
class App;
}

namespace megablock {

void add_measurements(CLI::App& app, std::function<int()>& action);

}  // namespace megablock
