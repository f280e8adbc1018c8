// Fits text to the width of the terminal.
#pragma once

#include <cstddef>
#include <optional>
#include <string>

namespace megablock {

// The environment variable COLUMNS, else the width of the terminal; none when the output goes elsewhere.
std::optional<std::size_t> terminal_columns();

// Breaks lines longer than `columns` between words and after commas. The rest of an option's line begins at column
// `description`, below its description; the rest of any other line `hanging` columns to the right of its beginning.
std::string wrapped(const std::string& text, std::size_t columns, std::size_t description, std::size_t hanging = 0);

// Wraps text for a person at a terminal. A program or a file gets whole lines, whatever COLUMNS says.
std::string for_terminal(const std::string& text);

}  // namespace megablock
