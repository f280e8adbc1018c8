// A table with the names of its columns in the first line (position_columns.h says which names are known), separated by
// commas, semicolons or tabs; or any table whose columns the project file names or numbers from 1 (`columns`). Where no
// column names the image, rows are epochs of a path.
//
// Latitudes and longitudes are WGS84 unless `crs` says otherwise; x and y need `crs`, in the file ("# crs: EPSG:25832")
// or in the project. Heights are metres, above the ellipsoid unless the system has a vertical part.
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

bool has_columns(const PositionText& text) { return names_rows(column_header(text).columns); }

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

PositionTable read_columns(const PositionText& text, const PositionOptions& options) {
  ColumnHeader header = column_header(text);
  for (const auto& [field, value] : options.columns) {
    const std::size_t column = column_of(header, field, value, text.path);
    header.columns.set(field, column, column < header.names.size() ? header.names[column] : "");
  }
  if (!names_rows(header.columns))
    throw InputError(text.where(text.lines[header.line]) +
                     ": the header names no columns of image (or time) and position; name them in the project file: "
                     "'columns: {image: ..., x: ..., y: ..., z: ...}'");
  PositionTable table;
  if (!header.columns.has("image")) table.kind = PositionTable::Kind::kPath;
  table.states_sigmas = header.columns.has_sigmas();
  table.states_angle_sigmas = header.columns.has_angle_sigmas();
  table.crs = crs_of_columns(text);
  if (table.crs.empty() && header.columns.geodetic()) table.crs = "WGS84";
  if (table.crs.empty() && options.crs.empty())
    throw InputError(
        text.where(text.lines[header.line]) +
        ": the columns x and y need a coordinate reference system; add 'crs: EPSG:...' beside 'file' in the "
        "project file");
  // A table whose columns are numbered may have no header.
  const std::vector<std::string>& names = header.names;
  bool has_header = true;
  for (const char* field : {"x", "latitude"})
    if (const auto found = options.columns.find(field); found != options.columns.end()) {
      const std::size_t column = column_of(header, field, found->second, text.path);
      if (column < names.size() && is_number(with_decimal_point(names[column], header.separator))) has_header = false;
    }
  for (std::size_t l = header.line + (has_header ? 1 : 0); l < text.lines.size(); ++l) {
    const TextLine& line = text.lines[l];
    if (line.text.front() == '#') continue;
    const auto row = header.columns.row(split_fields(line.text, header.separator), header.separator, text.where(line),
                                        options.angles);
    if (row) table.rows.push_back(*row);
  }
  header.columns.fit_to_system(options.crs.empty() ? table.crs : options.crs, text.path,
                               text.where(text.lines[header.line]), table.rows);
  return table;
}

}  // namespace

const PositionFormat kNamedColumns = {"columns", "table with a header", has_columns, read_columns};

}  // namespace megablock
