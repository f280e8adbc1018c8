// Reads a small CSV file: comments ("# key: value"), a header line, rows as in csv_row.h. The header
// tells the separator: commas, semicolons or tabs. With the last two, numbers may have a decimal comma, as spreadsheets
// write them in many countries. Internal to io/.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "io/text/plausible.h"

namespace megablock {

// The table of a file. Columns are addressed by their names in the header.
class CsvTable {
 public:
  // Throws InputError if the file cannot be read or is empty, or a row is too long.
  explicit CsvTable(const std::string& path);

  std::size_t row_count() const { return rows_.size(); }
  bool has(const std::string& column) const { return columns_.contains(column); }
  // Throws InputError with the name of a missing column, `remedy`, and the names that are needed and those that are
  // there.
  void require(const std::vector<std::string>& columns, const std::string& remedy = "") const;
  // Throws InputError for a column that is not in the list.
  void refuse_others(const std::vector<std::string>& columns) const;
  std::string text(std::size_t row, const std::string& column) const;              // "" if empty or absent
  std::optional<double> number(std::size_t row, const std::string& column) const;  // nothing if empty or NaN
  // The same; throws InputError outside the limits.
  std::optional<double> number(std::size_t row, const std::string& column, const Limits& limits) const;
  double needed_number(std::size_t row, const std::string& column) const;  // throws InputError if empty or NaN
  // And if farther away than any place on Earth.
  double needed_metres(std::size_t row, const std::string& column) const;
  std::string where(std::size_t row) const;
  // The value of a comment line "# key: value"; empty if there is none.
  std::string comment(const std::string& key) const;

 private:
  std::string number_text(std::size_t row, const std::string& column) const;  // with a decimal point

  std::string path_;
  char separator_ = ',';
  std::map<std::string, std::size_t> columns_;
  std::map<std::string, std::string> comments_;
  std::vector<std::vector<std::string>> rows_;
  std::vector<std::int64_t> lines_;
  std::int64_t header_line_ = 0;
};

}  // namespace megablock
