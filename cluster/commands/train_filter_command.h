// The command `train-filter` trains the match filter on a block whose wrong matches are known (Cannelle 2013).
#pragma once

#include <functional>

namespace CLI {
class App;
}

namespace megablock {

void add_train_filter(CLI::App& app, std::function<int()>& action);

}  // namespace megablock
