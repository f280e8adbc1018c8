// Text as wide as the terminal.
#pragma once

#include <cstddef>
#include <optional>
#include <string>

namespace megablock {

// The environment variable COLUMNS, else the terminal's width; none where the output goes elsewhere.
std::optional<std::size_t> terminal_columns();

// Breaks lines longer than `columns` between words and behind commas. What follows of an option's line stands below its
// description, which begins at column `description`; of any other `hanging` columns right of the line's own beginning.
std::string wrapped(const std::string& text, std::size_t columns, std::size_t description, std::size_t hanging = 0);

// What a person reads on a terminal; a program or a file gets whole lines, whatever COLUMNS says.
std::string for_terminal(const std::string& text);

}  // namespace megablock
