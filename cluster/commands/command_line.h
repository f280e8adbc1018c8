// Runs the program from its command line.
#pragma once

namespace megablock {

// Parses the command line, runs the command and returns the exit code. This is the only place where an error becomes a
// line on standard error and an exit code.
int command_line(int argc, char** argv);

}  // namespace megablock
