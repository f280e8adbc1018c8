// The command `calibrate`: of rigs, and its other modes.
#pragma once

#include <functional>

namespace CLI {
class App;
}

namespace megablock {

class Communicator;
struct RunOptions;

// Another mode of `calibrate`, in a file of its own. It adds its options to the command; when one of them chooses it,
// it runs in place of the calibration of rigs, with the project and the folder (RunOptions::directory) of the command.
struct CalibrateMode {
  std::function<bool()> chosen;               // asked after parsing
  std::function<int(const RunOptions&)> run;  // exit code
};

void add_calibrate(CLI::App& app, std::function<int()>& action, Communicator& ranks);

}  // namespace megablock
