#include "io/text/csv_row.h"

#include "io/base/error.h"

namespace megablock {

namespace {

constexpr std::string_view kBlanks = " \t\r";

bool is_blank(char letter) { return kBlanks.find(letter) != std::string_view::npos; }

// Where a reader is in a row.
enum class RowPlace {
  kStart,   // before the first letter of a field
  kPlain,   // in a field without quotes
  kOpen,    // between quotes
  kClosed,  // behind a quote: the last one of the field, or the first of two
};

RowPlace after(RowPlace place, char letter, char separator) {
  if (place == RowPlace::kOpen) return letter == '"' ? RowPlace::kClosed : RowPlace::kOpen;
  if (letter == separator) return RowPlace::kStart;
  if (letter == '"' && place != RowPlace::kPlain) return RowPlace::kOpen;
  return place == RowPlace::kStart && !is_blank(letter) ? RowPlace::kPlain : place;
}

RowPlace after(RowPlace place, std::string_view letters, char separator) {
  for (const char letter : letters) place = after(place, letter, separator);
  return place;
}

void remove_last_blanks(std::string& text) { text.erase(text.find_last_not_of(kBlanks) + 1); }

}  // namespace

std::string csv_field(std::string_view text) {
  const bool plain = text.empty() || (text.find_first_of(",\"\r\n") == std::string_view::npos && text.front() != '#' &&
                                      !is_blank(text.front()) && !is_blank(text.back()));
  if (plain) return std::string(text);
  std::string field = "\"";
  for (const char letter : text) field.append(letter == '"' ? 2 : 1, letter);
  return field + '"';
}

std::vector<std::string> csv_fields(std::string_view row, char separator) {
  std::vector<std::string> fields(1);
  RowPlace place = RowPlace::kStart;
  for (const char letter : row) {
    const RowPlace before = place;
    place = after(before, letter, separator);
    if (place == RowPlace::kStart && letter == separator) {
      if (before == RowPlace::kPlain) remove_last_blanks(fields.back());
      fields.emplace_back();
    } else if (place == RowPlace::kPlain || (place == RowPlace::kOpen && before != RowPlace::kStart) ||
               (place == RowPlace::kClosed && before == RowPlace::kClosed && !is_blank(letter))) {
      fields.back() += letter;
    }
  }
  if (place == RowPlace::kPlain) remove_last_blanks(fields.back());
  return fields;
}

bool read_csv_row(std::istream& stream, const std::string& path, std::string& row, std::int64_t& lines,
                  char separator) {
  if (!std::getline(stream, row)) return false;
  const std::int64_t first = ++lines;
  if (first == 1 && row.starts_with("\xef\xbb\xbf")) row.erase(0, 3);
  if (row.starts_with('#')) return true;
  std::string line;
  for (RowPlace place = after(RowPlace::kStart, row, separator); place == RowPlace::kOpen;
       place = after(place, line, separator)) {
    if (!std::getline(stream, line))
      throw InputError(path + ":" + std::to_string(first) +
                       ": a field begins with a quote that is not closed; close it, or double a quote that belongs to "
                       "the text");
    ++lines;
    row += '\n' + line;
  }
  return true;
}

}  // namespace megablock
