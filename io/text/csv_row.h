// Rows of CSV files by RFC 4180: fields between commas, and fields in double quotes that may hold commas, line breaks
// and quotes (written twice). Every writer and reader of CSV in the tree goes through these functions, so that a name
// that was written is read as the same name. We write commas; files of others may have another separator.
#pragma once

#include <cstdint>
#include <istream>
#include <string>
#include <string_view>
#include <vector>

namespace megablock {

// A text as a field. It is quoted only where a reader would take it for something else: where it has commas, quotes or
// line breaks, blanks at its ends, or begins with '#', as comments do.
std::string csv_field(std::string_view text);

// The fields of a row. Blanks around a field do not belong to it; blanks inside quotes do. A quote is a letter in a
// field that does not begin with one.
std::vector<std::string> csv_fields(std::string_view row, char separator = ',');

// Reads the next row without its line break. A field in quotes may go on in further lines; a comment ('#' in front) is
// a row. `lines` counts the lines that were read. A byte order mark before the first line is skipped, because programs
// on Windows often write one. Returns whether there was a row. Throws InputError "PATH:LINE: ..." for a quote that is
// not closed.
bool read_csv_row(std::istream& stream, const std::string& path, std::string& row, std::int64_t& lines,
                  char separator = ',');

}  // namespace megablock
