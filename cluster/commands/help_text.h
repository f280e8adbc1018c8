// Help as wide as the terminal.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace megablock {

// Breaks lines longer than `columns` between words and behind commas. What follows of an option's line stands below its
// description, which begins at column `description`; of any other below the line's own beginning.
std::string wrapped(const std::string& text, std::size_t columns, std::size_t description);

// Wraps to the environment variable COLUMNS, else to the terminal, else to 80. Footers, which are commands to be
// copied, stay as they are.
class HelpText : public CLI::Formatter {
 public:
  std::string make_help(const CLI::App* app, std::string name, CLI::AppFormatMode mode) const override;
};

}  // namespace megablock
