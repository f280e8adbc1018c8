#include "io/images/camera_table.h"

#include <charconv>

namespace megablock {

namespace {

// Letters and digits in lower case, the form in which the tables have names.
std::string plain_name(std::string_view name) {
  std::string plain;
  for (const char c : name) {
    if ((c >= 'a' && c <= 'z') || (c >= '0' && c <= '9')) plain += c;
    if (c >= 'A' && c <= 'Z') plain += static_cast<char>(c - 'A' + 'a');
  }
  return plain;
}

std::string_view next_field(std::string_view& line) {
  const std::size_t comma = line.find(',');
  const std::string_view field = line.substr(0, comma);
  line.remove_prefix(comma == std::string_view::npos ? line.size() : comma + 1);
  return field;
}

double number_of(std::string_view field) {
  double number = 0;  // remains zero in the header line
  std::from_chars(field.data(), field.data() + field.size(), number);
  return number;
}

}  // namespace

CameraTable::CameraTable(std::string_view text) {
  while (!text.empty()) {
    const std::size_t end = text.find('\n');
    std::string_view line = text.substr(0, end);
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    if (line.empty() || line.front() == '#') continue;
    const std::string_view make = next_field(line), model = next_field(line);
    const double figure = number_of(next_field(line)), fewest = number_of(next_field(line));
    if (figure > 0) lines_.emplace(model, Line{make, figure, fewest});
  }
}

std::optional<double> CameraTable::find_plain(const std::string& make, const std::string& model,
                                              double megapixels) const {
  const Line* best = nullptr;
  const auto [begin, end] = lines_.equal_range(model);
  for (auto entry = begin; entry != end; ++entry) {
    const Line& line = entry->second;
    // Makers add words to their name ("NIKON CORPORATION"), so the name of the table need only be contained.
    if (make.find(line.make) == std::string::npos || megapixels < line.fewest_megapixels) continue;
    if (best == nullptr || line.fewest_megapixels > best->fewest_megapixels) best = &line;
  }
  return best == nullptr ? std::nullopt : std::optional(best->figure);
}

std::optional<double> CameraTable::find(const std::string& make, const std::string& model, double megapixels) const {
  const std::string name = plain_name(model), maker = plain_name(make);
  if (const auto figure = find_plain(maker, name, megapixels)) return figure;
  // Many makers repeat their name before that of the model: "NIKON CORPORATION", "NIKON D800".
  const std::string first_word = plain_name(std::string_view(make).substr(0, make.find(' ')));
  for (const std::string& prefix : {maker, first_word})
    if (!prefix.empty() && name.starts_with(prefix))
      if (const auto figure = find_plain(maker, name.substr(prefix.size()), megapixels)) return figure;
  return std::nullopt;
}

}  // namespace megablock
