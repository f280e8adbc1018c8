// The command `calibrate` calibrates rigs and, in its other modes, single cameras.
#pragma once

#include <functional>

namespace CLI {
class App;
}

namespace megablock {

class Communicator;
struct RunOptions;

// A mode of `calibrate` besides the calibration of rigs. It adds its options to the command. If one of these options is
// given, the mode runs instead, with the project and the folder (RunOptions::directory) of the command.
struct CalibrateMode {
  std::function<bool()> chosen;               // whether one of its options is given; asked after parsing
  std::function<int(const RunOptions&)> run;  // exit code
};

void add_calibrate(CLI::App& app, std::function<int()>& action, Communicator& ranks);

}  // namespace megablock
