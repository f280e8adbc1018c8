#include "io/text/csv_table.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "io/base/error.h"
#include "io/text/csv_row.h"
#include "io/text/plausible.h"
#include "io/text/settings_reader.h"
#include "io/text/text_lines.h"

namespace megablock {

namespace {

std::string joined(const std::vector<std::string>& names) {
  std::string list;
  for (const std::string& name : names) list += (list.empty() ? "" : ",") + name;
  return list;
}

}  // namespace

CsvTable::CsvTable(const std::string& path) : path_(path) {
  std::istringstream stream(read_text(path));
  std::int64_t lines = 0, number = 1;  // of the row's first line
  for (std::string line; read_csv_row(stream, path, line, lines, separator_); number = lines + 1) {
    if (trimmed(line).empty()) continue;
    if (line.front() == '#') {
      const auto colon = line.find(':');
      if (colon != std::string::npos) comments_[trimmed(line.substr(1, colon - 1))] = trimmed(line.substr(colon + 1));
      continue;
    }
    const std::string place = path + ":" + std::to_string(number);
    // Spreadsheets may name their separator in a line of its own.
    if (columns_.empty() && lower_case(line).starts_with("sep=")) continue;
    if (columns_.empty()) separator_ = csv_separator(line);
    std::vector<std::string> fields = csv_fields(line, separator_);
    if (columns_.empty()) {
      header_line_ = number;
      for (std::size_t c = 0; c < fields.size(); ++c)
        if (!columns_.emplace(fields[c], c).second)
          throw InputError(place + ": column '" + fields[c] + "' appears twice");
      continue;
    }
    if (fields.size() > columns_.size())
      throw InputError(place + ": " + std::to_string(fields.size()) + " fields, but the header has only " +
                       std::to_string(columns_.size()) + "; delete surplus fields, or put texts with commas in quotes");
    // Fields that are missing at the end of a row are empty.
    fields.resize(columns_.size());
    rows_.push_back(std::move(fields));
    lines_.push_back(number);
  }
  if (columns_.empty()) throw InputError(path + ": is empty; expected a header line with the names of the columns");
}

void CsvTable::require(const std::vector<std::string>& columns, const std::string& remedy) const {
  for (const std::string& column : columns) {
    if (has(column)) continue;
    std::vector<std::string> found(columns_.size());
    for (const auto& [name, position] : columns_) found[position] = name;
    throw InputError(path_ + ":" + std::to_string(header_line_) + ": column '" + column + "' is missing" +
                     (remedy.empty() ? "" : "; " + remedy) + "; the header needs " + joined(columns) + ", and has " +
                     joined(found));
  }
}

void CsvTable::refuse_others(const std::vector<std::string>& columns) const {
  for (const auto& [name, position] : columns_)
    if (std::find(columns.begin(), columns.end(), name) == columns.end())
      throw InputError(path_ + ":" + std::to_string(header_line_) + ": " +
                       unknown_key_message(name, "the header", columns));
}

std::string CsvTable::text(std::size_t row, const std::string& column) const {
  const auto found = columns_.find(column);
  return found == columns_.end() ? "" : rows_[row][found->second];
}

std::string CsvTable::number_text(std::size_t row, const std::string& column) const {
  const std::string value = text(row, column);
  return separator_ == ',' ? value : with_decimal_point(value, Separator::kSemicolon);
}

std::optional<double> CsvTable::number(std::size_t row, const std::string& column) const {
  const std::string value = number_text(row, column);
  if (value.empty() || value == "NaN" || value == "nan") return std::nullopt;
  return parse_number(value, column, where(row));
}

std::optional<double> CsvTable::number(std::size_t row, const std::string& column, const Limits& limits) const {
  const std::optional<double> value = number(row, column);
  if (value) check_within(*value, limits, column, where(row));
  return value;
}

double CsvTable::needed_number(std::size_t row, const std::string& column) const {
  const std::string value = number_text(row, column);
  if (value.empty()) throw InputError(where(row) + ": " + column + " is empty");
  return parse_number(value, column, where(row));
}

double CsvTable::needed_metres(std::size_t row, const std::string& column) const {
  const double metres = needed_number(row, column);
  check_on_earth(metres, column, where(row));
  return metres;
}

std::string CsvTable::where(std::size_t row) const { return path_ + ":" + std::to_string(lines_[row]); }

std::string CsvTable::comment(const std::string& key) const {
  const auto found = comments_.find(key);
  return found == comments_.end() ? "" : found->second;
}

}  // namespace megablock
