// The command `diagnose` finds gaps, weak links and missing overlap of a block, before or after its adjustment
// (Kalantari 2009).
#pragma once

#include <functional>

namespace CLI {
class App;
}

namespace megablock {

void add_diagnose(CLI::App& app, std::function<int()>& action);

}  // namespace megablock
