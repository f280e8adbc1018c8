#include "io/text/settings_reader.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <numeric>

#include "io/base/error.h"

namespace megablock {

namespace {

// The text after the number, or the whole text if it does not begin with a number.
template <typename Value>
std::string parse_leading(const std::string& text, Value& value) {
  const char* begin = text.data() + (text.size() > 1 && text[0] == '+' ? 1 : 0);
  const auto [end, error] = std::from_chars(begin, text.data() + text.size(), value);
  return error == std::errc() ? std::string(end, text.data() + text.size()) : text;
}

std::string in_apostrophes(const std::string& text) { return "'" + text + "'"; }

// Levenshtein's edit distance, for the suggestion in a message.
std::size_t edit_distance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), 0);
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, replaced});
    }
  }
  return row[b.size()];
}

}  // namespace

double parse_number(const std::string& text, const std::string& what, const std::string& where) {
  double value = 0;
  const std::string rest = parse_leading(text, value);
  if (rest == text || text.empty())
    throw InputError(where + ": " + what + ": " + in_apostrophes(text) + " is not a number");
  if (!rest.empty())
    throw InputError(where + ": " + what + ": " + in_apostrophes(text) + " has text after the number (" +
                     in_apostrophes(rest) + "); write the number alone, its unit is fixed");
  if (!std::isfinite(value))
    throw InputError(where + ": " + what + ": " + in_apostrophes(text) + " is not a finite number");
  return value;
}

std::int64_t parse_integer(const std::string& text, const std::string& what, const std::string& where) {
  std::int64_t value = 0;
  const std::string rest = parse_leading(text, value);
  // "8.5" leaves ".5": a fraction is refused, not cut off.
  if (text.empty() || !rest.empty())
    throw InputError(where + ": " + what + ": " + in_apostrophes(text) + " is not a whole number");
  return value;
}

bool parse_flag(const std::string& text, const std::string& what, const std::string& where) {
  if (text == "true") return true;
  if (text == "false") return false;
  throw InputError(where + ": " + what + ": " + in_apostrophes(text) + " is neither true nor false");
}

std::string nearest_name(const std::string& name, const std::vector<std::string>& known) {
  std::string nearest;
  // At most two changes, or a third of the letters: beyond that, a suggestion would be a guess.
  std::size_t best = std::max<std::size_t>(2, name.size() / 3) + 1;
  for (const std::string& candidate : known) {
    const std::size_t distance = edit_distance(name, candidate);
    if (distance >= best) continue;
    best = distance;
    nearest = candidate;
  }
  return nearest;
}

std::string unknown_key_message(const std::string& key, const std::string& section,
                                const std::vector<std::string>& known) {
  std::string message =
      "unknown key " + in_apostrophes(key) + (section.empty() ? "" : " in " + in_apostrophes(section)) + ";";
  const std::string nearest = nearest_name(key, known);
  if (!nearest.empty()) message += " did you mean " + in_apostrophes(nearest) + "?";
  std::string list;
  for (const std::string& name : known) list += (list.empty() ? "" : ", ") + name;
  return message + " known keys: " + (list.empty() ? "none" : list);
}

SettingsReader::SettingsReader(const StageSettings& settings, std::string section)
    : settings_(settings), section_(std::move(section)) {}

const StageSettings::Entry* SettingsReader::find(const std::string& key) {
  known_.push_back(key);
  for (const StageSettings::Entry& entry : settings_.entries)
    if (entry.section == section_ && entry.key == key) return &entry;
  return nullptr;
}

bool SettingsReader::number(const std::string& key, double& field) {
  const auto* entry = find(key);
  if (entry) field = parse_number(entry->value, section_ + "." + key, entry->where);
  return entry != nullptr;
}

bool SettingsReader::integer(const std::string& key, std::int64_t& field) {
  const auto* entry = find(key);
  if (entry) field = parse_integer(entry->value, section_ + "." + key, entry->where);
  return entry != nullptr;
}

bool SettingsReader::integer(const std::string& key, int& field) {
  std::int64_t value = field;
  if (!integer(key, value)) return false;
  if (value < std::numeric_limits<int>::min() || value > std::numeric_limits<int>::max())
    throw InputError(find(key)->where + ": " + section_ + "." + key + ": " + std::to_string(value) +
                     " is out of range");
  field = static_cast<int>(value);
  return true;
}

bool SettingsReader::flag(const std::string& key, bool& field) {
  const auto* entry = find(key);
  if (entry) field = parse_flag(entry->value, section_ + "." + key, entry->where);
  return entry != nullptr;
}

bool SettingsReader::text(const std::string& key, std::string& field) {
  const auto* entry = find(key);
  if (entry) field = entry->value;
  return entry != nullptr;
}

bool SettingsReader::choice(const std::string& key, const std::vector<std::string>& choices, int& field) {
  const auto* entry = find(key);
  if (!entry) return false;
  const auto found = std::find(choices.begin(), choices.end(), entry->value);
  if (found == choices.end()) {
    std::string list;
    for (const std::string& choice : choices) list += (list.empty() ? "" : ", ") + choice;
    throw InputError(entry->where + ": " + section_ + "." + key + ": " + in_apostrophes(entry->value) +
                     " is not one of: " + list);
  }
  field = static_cast<int>(found - choices.begin());
  return true;
}

void SettingsReader::finish() const {
  for (const StageSettings::Entry& entry : settings_.entries)
    if (entry.section == section_ && std::find(known_.begin(), known_.end(), entry.key) == known_.end())
      throw InputError(entry.where + ": " + unknown_key_message(entry.key, section_, known_));
}

}  // namespace megablock
