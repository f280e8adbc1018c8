// Help as wide as the terminal.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace megablock {

// Wraps to the terminal (terminal_text.h), else to 80 columns. Footers, which are commands to be
// copied, stay as they are.
class HelpText : public CLI::Formatter {
 public:
  std::string make_help(const CLI::App* app, std::string name, CLI::AppFormatMode mode) const override;
};

}  // namespace megablock
