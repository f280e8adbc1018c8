#include "io/text/csv_row.h"

#include "io/base/error.h"

namespace megablock {

namespace {

constexpr std::string_view kBlanks = " \t\r";

bool is_blank(char letter) { return kBlanks.find(letter) != std::string_view::npos; }

// Where a reader is in a row.
enum class Place {
  kStart,   // before the first letter of a field
  kPlain,   // in a field without quotes
  kOpen,    // between quotes
  kClosed,  // behind a quote: the last one of the field, or the first of two
};

Place after(Place place, char letter) {
  if (place == Place::kOpen) return letter == '"' ? Place::kClosed : Place::kOpen;
  if (letter == ',') return Place::kStart;
  if (letter == '"' && place != Place::kPlain) return Place::kOpen;
  return place == Place::kStart && !is_blank(letter) ? Place::kPlain : place;
}

Place after(Place place, std::string_view letters) {
  for (const char letter : letters) place = after(place, letter);
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

std::vector<std::string> csv_fields(std::string_view row) {
  std::vector<std::string> fields(1);
  Place place = Place::kStart;
  for (const char letter : row) {
    const Place before = place;
    place = after(before, letter);
    if (place == Place::kStart && letter == ',') {
      if (before == Place::kPlain) remove_last_blanks(fields.back());
      fields.emplace_back();
    } else if (place == Place::kPlain || (place == Place::kOpen && before != Place::kStart) ||
               (place == Place::kClosed && before == Place::kClosed && !is_blank(letter))) {
      fields.back() += letter;
    }
  }
  if (place == Place::kPlain) remove_last_blanks(fields.back());
  return fields;
}

bool read_csv_row(std::istream& stream, const std::string& path, std::string& row, std::int64_t& lines) {
  if (!std::getline(stream, row)) return false;
  const std::int64_t first = ++lines;
  if (first == 1 && row.starts_with("\xef\xbb\xbf")) row.erase(0, 3);
  if (row.starts_with('#')) return true;
  std::string line;
  for (Place place = after(Place::kStart, row); place == Place::kOpen; place = after(place, line)) {
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
