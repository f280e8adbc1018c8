// Formats the help of commands for the width of the terminal.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace megablock {

// Wraps lines at the width of the terminal (terminal_text.h), else at 80 columns. Footers hold commands to copy, and
// are not wrapped.
class HelpText : public CLI::Formatter {
 public:
  std::string make_help(const CLI::App* app, std::string name, CLI::AppFormatMode mode) const override;
};

}  // namespace megablock
