// Says what is wrong with a command line, and what was probably meant.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace megablock {

// Whether `name`, the first argument, is neither an option nor a command of the program.
bool is_unknown_command(const CLI::App& app, const std::string& name);
// "megablock: unknown command 'rum'; did you mean 'run'?".
std::string unknown_command_message(const CLI::App& app, const std::string& name);

// The message for arguments that the command `name` does not take. A misspelled option is named first, because a
// missing option may be the one that was meant.
std::string usage_message(const CLI::App& command, const std::string& name, const CLI::Error& error);

// Names a wrong value as the user gave it: "--min-frames 9: min_frames must be 3 or 4".
std::string with_given_value(const CLI::App& app, const std::string& message);

}  // namespace megablock
