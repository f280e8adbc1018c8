// The command line.
#pragma once

namespace megablock {

// Parses, runs, and turns every error into one line on standard error and an exit code: the one place that does.
int command_line(int argc, char** argv);

}  // namespace megablock
