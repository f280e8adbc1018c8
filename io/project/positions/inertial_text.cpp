// Text exports of programs for inertial navigation (Inertial Explorer, POSPac): some lines of text, a line that names
// the columns, perhaps one of their units, and an epoch in each line after it, with blanks, tabs or commas between the
// fields:
//
//     GPSTime      Latitude        Longitude     H-Ell   Heading   Pitch   Roll  SDNorth SDEast SDHeight ...
//       (sec)         (deg)            (deg)       (m)     (deg)   (deg)  (deg)      (m)    (m)      (m) ...
//     126000.000  48.1171234567   11.5167012345  545.123  91.2345  0.1234 -0.5432   0.008  0.007    0.012 ...
//
// The names of columns are those of position_columns.h. Angles are those of the body (yaw, pitch, roll), unless the
// project file says otherwise. Times are seconds of the GPS week; a column "Week" makes them absolute.
//
// Source: NovAtel, Waypoint Software User Guide, export wizard and variables.
#include <fmt/core.h>

#include <algorithm>

#include "io/base/error.h"
#include "io/project/positions/position_columns.h"
#include "io/project/positions/position_formats.h"

namespace megablock {

namespace {

struct InertialHeader {
  PositionColumns columns;
  std::size_t line = 0;   // among the lines of the text; past the end: none
  std::size_t names = 0;  // of columns
};

// Text exports have blanks or commas throughout; blanks stand beside commas in some.
std::vector<std::string> inertial_fields(const std::string& line) { return split_fields(line, separator_of(line)); }

// The line under the names may state their units: "(sec) (deg) (deg) (ft)". They are joined to the names.
void join_units(const PositionText& text, std::size_t line, std::vector<std::string>& names) {
  if (line >= text.lines.size()) return;
  const std::vector<std::string> units = inertial_fields(text.lines[line].text);
  if (units.size() != names.size()) return;
  if (!std::ranges::all_of(units, [](const std::string& unit) { return unit.starts_with('('); })) return;
  for (std::size_t c = 0; c < names.size(); ++c) names[c] += units[c];
}

InertialHeader inertial_header(const PositionText& text) {
  constexpr std::size_t kLongestPreamble = 100;  // lines
  for (std::size_t l = 0; l < std::min(text.lines.size(), kLongestPreamble); ++l) {
    std::vector<std::string> names = inertial_fields(text.lines[l].text);
    join_units(text, l + 1, names);
    InertialHeader header{PositionColumns(names), l, names.size()};
    if (header.columns.has("time") && header.columns.has_place() && !header.columns.has("image")) return header;
  }
  return {{}, text.lines.size(), 0};
}

bool is_inertial(const PositionText& text) { return inertial_header(text).line < text.lines.size(); }

bool is_epoch(const std::vector<std::string>& fields) { return fields.size() > 3 && is_number(fields[0]); }

PositionTable read_inertial(const PositionText& text, const PositionOptions& options) {
  const InertialHeader header = inertial_header(text);
  if (header.line == text.lines.size())
    throw InputError(text.path +
                     ": no line names columns of time and position (GPSTime, Latitude, Longitude, H-Ell, or Easting, "
                     "Northing); export the names of the columns as well");
  PositionTable table;
  table.kind = PositionTable::Kind::kPath;
  table.states_sigmas = header.columns.has_sigmas();
  table.states_angle_sigmas = header.columns.has_angle_sigmas();
  if (!header.columns.geodetic() && options.crs.empty())
    throw InputError(text.where(text.lines[header.line]) +
                     ": easting and northing need a coordinate reference system; add 'crs: EPSG:...' beside 'file' in "
                     "the project file");
  for (std::size_t l = header.line + 1; l < text.lines.size(); ++l) {
    const TextLine& line = text.lines[l];
    const std::vector<std::string> fields = inertial_fields(line.text);
    if (!is_epoch(fields)) continue;  // units, and lines at the end
    if (fields.size() != header.names)
      throw InputError(
          fmt::format("{}: {} fields under {} names of columns; export angles in decimal degrees, and "
                      "names of columns without blanks",
                      text.where(line), fields.size(), header.names));
    const auto row = header.columns.row(fields, separator_of(line.text), text.where(line), options.angles);
    if (row) table.rows.push_back(*row);
  }
  header.columns.fit_to_system(options.crs.empty() ? table.crs : options.crs, text.path,
                               text.where(text.lines[header.line]), table.rows);
  return table;
}

}  // namespace

const PositionFormat kInertial = {"inertial", "text of Inertial Explorer or POSPac", is_inertial, read_inertial};

}  // namespace megablock
