// The command 'diagnose': what a block lacks, before or after its adjustment (M57).
#pragma once

#include <functional>

namespace CLI {
class App;
}

namespace megablock {

void add_diagnose(CLI::App& app, std::function<int()>& action);

}  // namespace megablock
