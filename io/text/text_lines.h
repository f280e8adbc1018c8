// Reads text files as people and programs write them: with or without a byte order mark, in UTF-8 or UTF-16, with the
// line ends of any system, with blanks, tabs, commas or semicolons between the fields, and with fields in quotes.
// Internal to io/.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace megablock {

// The text of a file as UTF-8 without byte order mark, with line feeds in place of the line ends of old Macs. Throws
// InputError if the file cannot be read.
std::string read_text(const std::string& path);

struct TextLine {
  std::string text;  // without line end, and without blanks at both ends
  std::int64_t number = 0;
};

// The lines of a file that are not empty, as UTF-8. Throws InputError if the file cannot be read.
std::vector<TextLine> read_text_lines(const std::string& path);

enum class Separator : std::uint8_t { kBlanks, kTab, kComma, kSemicolon };

// The fields of a line, without blanks at their ends and without the quotes around them. A separator inside quotes
// belongs to the field. Blanks count once, however many follow each other; the other separators enclose empty fields.
std::vector<std::string> split_fields(const std::string& line, Separator separator);

// The separator of a line of names: tab, semicolon or comma, whichever makes most fields; blanks if none occurs.
Separator separator_of(const std::string& line);

// The letter that separates the columns of a CSV header: a semicolon, a tab or a comma.
char csv_separator(const std::string& header);

// A number with a decimal comma becomes one with a point, if commas are not the separator. Other texts stay as they
// are.
std::string with_decimal_point(const std::string& text, Separator separator);

// Whether the whole text is a finite number.
bool is_number(const std::string& text);

std::string trimmed(const std::string& text);     // without blanks, tabs and line ends at both ends
std::string lower_case(const std::string& text);  // of the letters of ASCII

}  // namespace megablock
