// The command `coplanarity` computes the attitudes of the frames of a job by the determinant method
// (adjust/coplanarity/coplanarity_adjustment.h).
#pragma once

#include <functional>

namespace CLI {
class App;
}

namespace megablock {

void add_coplanarity(CLI::App& app, std::function<int()>& action);

}  // namespace megablock
