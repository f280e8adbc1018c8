// A small CSV file: comments ("# key: value"), a header line, rows. Fields may be quoted ("a, b"). Internal to io/.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "io/text/plausible.h"

namespace megablock {

// InputError "where: ..." for a header whose columns are separated by semicolons.
void refuse_semicolons(const std::string& header, const std::string& where);

class CsvTable {
 public:
  explicit CsvTable(const std::string& path);  // InputError when it cannot be read, is empty, or a row is too long

  std::size_t row_count() const { return rows_.size(); }
  bool has(const std::string& column) const { return columns_.contains(column); }
  void require(const std::vector<std::string>& columns) const;         // InputError naming the missing one
  void refuse_others(const std::vector<std::string>& columns) const;   // InputError for a column not in the list
  std::string text(std::size_t row, const std::string& column) const;  // "" when empty or absent
  std::optional<double> number(std::size_t row, const std::string& column) const;  // none when empty or NaN
  // And InputError outside of the limits.
  std::optional<double> number(std::size_t row, const std::string& column, const Limits& limits) const;
  double needed_number(std::size_t row, const std::string& column) const;  // InputError when empty or NaN
  double needed_metres(std::size_t row, const std::string& column) const;  // and when beyond any place on Earth
  std::string where(std::size_t row) const;
  // Value of a comment line "# key: value"; empty when absent.
  std::string comment(const std::string& key) const;

 private:
  std::string path_;
  std::map<std::string, std::size_t> columns_;
  std::map<std::string, std::string> comments_;
  std::vector<std::vector<std::string>> rows_;
  std::vector<std::int64_t> lines_;
  std::int64_t header_line_ = 0;
};

}  // namespace megablock
