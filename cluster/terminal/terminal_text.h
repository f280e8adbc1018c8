// Fits text to the width of the terminal.
#pragma once

#include <cstddef>
#include <optional>
#include <string>

namespace megablock {

// The value of the environment variable COLUMNS, else the width of the terminal. None when the output does not go to a
// terminal.
std::optional<std::size_t> terminal_columns();

// Breaks lines longer than `columns` between words and after commas. The continuation of an option's line begins at
// column `description`, below the description of the option; that of any other line begins `hanging` columns to the
// right of the line.
std::string wrapped(const std::string& text, std::size_t columns, std::size_t description, std::size_t hanging = 0);

// Wraps text for a person at a terminal. A program or a file gets unbroken lines, whatever COLUMNS says.
std::string for_terminal(const std::string& text);

}  // namespace megablock
