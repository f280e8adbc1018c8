// geo.txt of OpenDroneMap. The first line names the coordinate reference system (io/block/crs.h); every other line is
//
//     image x y [z] [yaw pitch roll] [horizontal accuracy, vertical accuracy] [extras]
//
// x is easting or longitude, in the unit of the system; z metres, above the ellipsoid unless the system has a vertical
// part. Accuracies are metres. ODM uses the angles for radiometry only, lets 0 stand for unknown ones and defines no
// axes, so they count only where the project file says what they are (`angles`). GeoFields may also be separated by
// tabs, commas or semicolons.
//
// Sources: docs.opendronemap.org/geo; OpenDroneMap/ODM, opendm/geo (the number of fields that makes angles and
// accuracies).
#include <cmath>

#include "io/base/error.h"
#include "io/project/positions/position_fields.h"
#include "io/project/positions/position_formats.h"

namespace megablock {

namespace {

constexpr std::size_t kGeoAngles = 4, kGeoAccuracies = 7;  // the first fields of these groups

struct GeoFields {
  std::vector<std::string> text;
  Separator separator = Separator::kBlanks;
};

// Splits a line so that two numbers follow the name of the image.
GeoFields geo_fields(const std::string& line) {
  for (const Separator separator : {Separator::kTab, Separator::kSemicolon, Separator::kComma, Separator::kBlanks}) {
    GeoFields fields{split_fields(line, separator), separator};
    const auto number = [&](std::size_t f) { return is_number(with_decimal_point(fields.text[f], separator)); };
    if (fields.text.size() > 2 && number(1) && number(2)) return fields;
  }
  return {split_fields(line, Separator::kBlanks), Separator::kBlanks};
}

// Names of images may be numbers. A line of a list of control points then has a name in its sixth field.
bool is_geo_row(const GeoFields& fields) {
  const std::vector<std::string>& text = fields.text;
  return text.size() > 2 && (!is_number(text[0]) || text.size() < 6 || is_number(text[5]));
}

// The lines that are not comments.
std::vector<TextLine> geo_lines(const PositionText& text) {
  std::vector<TextLine> lines;
  for (const TextLine& line : text.lines)
    if (line.text.front() != '#') lines.push_back(line);
  return lines;
}

bool is_geo(const PositionText& text) {
  const std::vector<TextLine> lines = geo_lines(text);
  if (lines.size() < 2) return false;
  const std::string head = lower_case(lines[0].text);
  const bool names_system = head.find("epsg") != std::string::npos || head.front() == '+' || head.starts_with("wgs") ||
                            head.find("utm") != std::string::npos || head.find("cs[") != std::string::npos ||
                            head.find("crs[") != std::string::npos;
  const GeoFields second = geo_fields(lines[1].text);
  return names_system && is_geo_row(second) && is_number(with_decimal_point(second.text[1], second.separator));
}

PositionTable read_geo(const PositionText& text, const PositionOptions& options) {
  PositionTable table;
  const std::vector<TextLine> lines = geo_lines(text);
  if (lines.empty()) return table;
  table.crs = lines[0].text;
  bool angles = false;
  for (std::size_t l = 1; l < lines.size(); ++l) {
    const std::string where = text.where(lines[l]);
    const GeoFields fields = geo_fields(lines[l].text);
    if (fields.text.size() < 3)
      throw InputError(where + ": " + std::to_string(fields.text.size()) +
                       " fields in this line; expected image x y [z] [yaw pitch roll] [accuracies]");
    const auto number = [&](std::size_t f, const char* what) {
      return position_number(fields.text[f], fields.separator, what, where);
    };
    PositionTable::Row row;
    row.where = where;
    row.image = fields.text[0];
    row.place.head<2>() = Eigen::Vector2d(number(1, "x"), number(2, "y"));
    if (fields.text.size() > 3 && lower_case(fields.text[3]) != "nan") row.place.z() = number(3, "z");
    if (fields.text.size() >= kGeoAngles + 3) {
      const Eigen::Vector3d values(number(kGeoAngles, "yaw"), number(kGeoAngles + 1, "pitch"),
                                   number(kGeoAngles + 2, "roll"));
      angles = angles || !values.isZero(0);
      if (options.angles) {
        row.angles_deg = values;
        row.angles = *options.angles;
      }
    }
    if (fields.text.size() >= kGeoAccuracies + 2)
      read_sigmas(fields.text, kGeoAccuracies, fields.separator, where, row);
    table.rows.push_back(row);
  }
  if (angles && !options.angles)
    table.notes.push_back(text.path +
                          ": its angles are not used, because the format does not define them; say what they are with "
                          "'angles: yaw_pitch_roll' (pitch 0 = nadir), 'gimbal' or 'omega_phi_kappa'");
  return table;
}

}  // namespace

const PositionFormat kOdmGeo = {"odm_geo", "geo.txt of OpenDroneMap", is_geo, read_geo};

}  // namespace megablock
