// A table with the names of its columns in the first line (position_columns.h says which names are known), separated by
// commas, semicolons or tabs; or any table whose columns the project file names or numbers from 1 (`columns`). Where no
// column names the image, rows are epochs of a path.
//
// Latitudes and longitudes are WGS84 unless `crs` says otherwise; x and y need `crs`, in the file ("# crs: EPSG:25832")
// or in the project. Heights are metres, above the ellipsoid unless the system has a vertical part.
#include <fmt/core.h>

#include <algorithm>
#include <charconv>

#include "io/base/error.h"
#include "io/project/positions/position_columns.h"
#include "io/project/positions/position_fields.h"
#include "io/project/positions/position_formats.h"

namespace megablock {

namespace {

// Whether rows have a place, and an image or a time that it belongs to.
bool names_rows(const PositionColumns& columns) {
  return columns.has_place() && (columns.has("image") || columns.has("time"));
}

// The first line that is not a comment, or a comment that names columns.
struct ColumnHeader {
  PositionColumns columns;
  Separator separator = Separator::kComma;
  std::size_t line = 0;  // among the lines of the text
  std::vector<std::string> names;
  bool complete = true;  // every column that is used has a name
};

ColumnHeader column_header(const PositionText& text) {
  ColumnHeader header;
  for (std::size_t l = 0; l < text.lines.size(); ++l) {
    std::string line = text.lines[l].text;
    if (lower_case(line).starts_with("sep=")) continue;
    const bool comment = line.front() == '#';
    if (comment) line = trimmed(line.substr(1));
    header.separator = separator_of(line);
    header.names = split_fields(line, header.separator);
    header.columns = PositionColumns(header.names);
    header.line = l;
    if (!comment || names_rows(header.columns)) return header;
  }
  return header;
}

// A line of units under the names, "(sec) (deg) (deg) (m)", is that of inertial_text.cpp.
bool has_columns(const PositionText& text) {
  const ColumnHeader header = column_header(text);
  const bool units = header.line + 1 < text.lines.size() && text.lines[header.line + 1].text.starts_with('(');
  return names_rows(header.columns) && !units;
}

// The column that the project names for a field: a name of the header, or its number from 1.
std::size_t column_of(const ColumnHeader& header, const std::string& field, const std::string& value,
                      const std::string& path) {
  for (std::size_t c = 0; c < header.names.size(); ++c)
    if (header.names[c] == value) return c;
  std::size_t number = 0;
  const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), number);
  if (error == std::errc() && end == value.data() + value.size() && number > 0) return number - 1;
  throw InputError(path + ": columns." + field + ": the header has no column '" + value +
                   "'; write its name as the file does, or its number from 1");
}

std::string crs_of_columns(const PositionText& text) {
  for (const TextLine& line : text.lines)
    if (lower_case(line.text).starts_with("# crs:")) return trimmed(line.text.substr(6));
  return "";
}

// Throws InputError for a row with more fields than names: its values would be read from the wrong columns.
void check_field_count(const std::vector<std::string>& fields, const ColumnHeader& header, const std::string& where) {
  std::size_t count = fields.size();
  while (count > 0 && fields[count - 1].empty()) --count;
  if (count <= header.names.size()) return;
  throw InputError(fmt::format("{}: {} fields under {} names of columns; {}", where, fields.size(), header.names.size(),
                               header.separator == Separator::kComma
                                   ? "decimal commas need semicolons or tabs between the fields, texts with commas "
                                     "need quotes"
                                   : "name every column, and put texts that contain a separator in quotes"));
}

// Collects rows that end before their image or coordinates, for one note about all of them.
class CutRows {
 public:
  void add(const std::vector<std::string>& fields, const ColumnHeader& header, const std::string& where) {
    if (count_++ == 0)
      first_ = fmt::format("{}: the line ends after {} of {} fields", where, fields.size(), header.names.size());
  }
  void report(std::vector<std::string>& notes) const {
    if (count_ == 0) return;
    const std::string all = count_ > 1 ? fmt::format(" ({} such lines in all)", count_) : "";
    notes.push_back(first_ + ", before its image or coordinates, and is not used" + all + "; complete it");
  }

 private:
  std::size_t count_ = 0;
  std::string first_;
};

std::string quoted_names(const std::vector<std::string>& names) {
  constexpr std::size_t kNamed = 20;
  std::string list;
  for (std::size_t n = 0; n < std::min(names.size(), kNamed); ++n) list += (n ? ", '" : "'") + names[n] + "'";
  return names.size() > kNamed ? list + ", ..." : list;
}

std::string said_names(const ColumnHeader& header) {
  return header.names.empty() ? "" : "; its names are " + quoted_names(header.names);
}

// The columns of the header, and those that the project names. Throws InputError if rows then have no place or owner.
ColumnHeader needed_columns(const PositionText& text, const PositionOptions& options) {
  ColumnHeader header = column_header(text);
  for (const auto& [field, value] : options.columns) {
    const std::size_t column = column_of(header, field, value, text.path);
    header.columns.set(field, column, column < header.names.size() ? header.names[column] : "");
    header.complete = header.complete && column < header.names.size();
  }
  if (!names_rows(header.columns))
    throw InputError(text.where(text.lines[header.line]) +
                     ": the header names no columns of image (or time) and position" + said_names(header) +
                     "; name them in the project file: 'columns: {image: ..., x: ..., y: ..., z: ...}'");
  return header;
}

// A table whose columns are numbered may have no header.
bool is_row(const ColumnHeader& header, const PositionText& text, const PositionOptions& options) {
  for (const char* field : {"x", "latitude"})
    if (const auto found = options.columns.find(field); found != options.columns.end()) {
      const std::size_t column = column_of(header, field, found->second, text.path);
      if (column < header.names.size() && is_number(with_decimal_point(header.names[column], header.separator)))
        return true;
    }
  return false;
}

void read_rows(const PositionText& text, const ColumnHeader& header, const PositionOptions& options,
               PositionTable& table) {
  const bool has_names = !is_row(header, text, options);
  CutRows cut;
  for (std::size_t l = header.line + (has_names ? 1 : 0); l < text.lines.size(); ++l) {
    const TextLine& line = text.lines[l];
    if (line.text.front() == '#') continue;
    const std::string where = text.where(line);
    const std::vector<std::string> fields = split_fields(line.text, header.separator);
    if (has_names && header.complete) check_field_count(fields, header, where);
    if (const auto row = header.columns.row(fields, header.separator, where, options.angles))
      table.rows.push_back(*row);
    else if (has_names && fields.size() < header.names.size())
      cut.add(fields, header, where);
  }
  cut.report(table.notes);
}

// Heights above the take-off are no heights of a system.
void note_relative_heights(const ColumnHeader& header, const std::string& where, PositionTable& table) {
  if (header.columns.has("height") || header.columns.has("z")) return;
  for (const std::string& name : header.names) {
    std::string letters = column_name(name).name;
    std::erase(letters, '_');
    const auto contains = [&](const char* part) { return letters.find(part) != std::string::npos; };
    if (!contains("relativealt") && !contains("relativeheight") && !contains("relalt") && !contains("abovetakeoff"))
      continue;
    table.notes.push_back(where + ": column '" + name +
                          "' counts from the take-off and is no height; give heights above the ellipsoid, or above the "
                          "geoid with a vertical part of 'crs', in a column 'height'");
    return;
  }
}

PositionTable read_columns(const PositionText& text, const PositionOptions& options) {
  const ColumnHeader header = needed_columns(text, options);
  const std::string where = text.where(text.lines[header.line]);
  PositionTable table;
  if (!header.columns.has("image")) table.kind = PositionTable::Kind::kPath;
  table.states_sigmas = header.columns.has_sigmas();
  table.states_angle_sigmas = header.columns.has_angle_sigmas();
  table.crs = crs_of_columns(text);
  if (table.crs.empty() && header.columns.geodetic()) table.crs = "WGS84";
  if (table.crs.empty() && options.crs.empty())
    throw InputError(
        where +
        ": the columns x and y need a coordinate reference system; add 'crs: EPSG:...' beside 'file' in the "
        "project file");
  note_relative_heights(header, where, table);
  read_rows(text, header, options, table);
  header.columns.fit_to_system(options.crs.empty() ? table.crs : options.crs, text.path, where, table.rows);
  return table;
}

}  // namespace

std::string names_of_header(const PositionText& text) {
  if (text.binary || text.lines.empty()) return "";
  const ColumnHeader header = column_header(text);
  const auto number = [&](const std::string& name) { return is_number(with_decimal_point(name, header.separator)); };
  const bool list = header.separator != Separator::kBlanks && header.names.size() > 2;
  return list && std::ranges::none_of(header.names, number) ? quoted_names(header.names) : "";
}

const PositionFormat kNamedColumns = {"columns", "table with a header", has_columns, read_columns};

}  // namespace megablock
