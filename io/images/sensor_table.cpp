#include "io/images/sensor_table.h"

#include <charconv>
#include <map>
#include <string_view>

#include "io/sensor_widths.h"

namespace megablock {

namespace {

struct Sensor {
  std::string_view make;  // empty: any make
  double width_mm;
};
using SensorTable = std::multimap<std::string_view, Sensor, std::less<>>;  // by model

// Letters and digits in lower case, the form in which the table has names.
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

SensorTable read_table(std::string_view text) {
  SensorTable table;
  while (!text.empty()) {
    const std::size_t end = text.find('\n');
    std::string_view line = text.substr(0, end);
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    if (line.empty() || line.front() == '#') continue;
    const std::string_view make = next_field(line), model = next_field(line), width = next_field(line);
    double width_mm = 0;  // remains zero in the header line
    std::from_chars(width.data(), width.data() + width.size(), width_mm);
    if (width_mm > 0) table.emplace(model, Sensor{make, width_mm});
  }
  return table;
}

std::optional<double> find_width(const SensorTable& table, const std::string& make, const std::string& model) {
  const auto [begin, end] = table.equal_range(model);
  for (auto entry = begin; entry != end; ++entry)
    // Makers add words to their name ("NIKON CORPORATION"), so the name of the table need only be contained.
    if (make.find(entry->second.make) != std::string::npos) return entry->second.width_mm;
  return std::nullopt;
}

}  // namespace

std::optional<double> sensor_width_mm(const std::string& make, const std::string& model) {
  static const SensorTable table = read_table(kSensorWidths);
  const std::string name = plain_name(model), maker = plain_name(make);
  if (const auto width = find_width(table, maker, name)) return width;
  // Many makers repeat their name before that of the model: "NIKON CORPORATION", "NIKON D800".
  const std::string first_word = plain_name(std::string_view(make).substr(0, make.find(' ')));
  for (const std::string& prefix : {maker, first_word})
    if (!prefix.empty() && name.starts_with(prefix))
      if (const auto width = find_width(table, maker, name.substr(prefix.size()))) return width;
  return std::nullopt;
}

}  // namespace megablock
