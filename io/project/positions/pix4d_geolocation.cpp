// Geolocation file of Pix4D (PIX4Dmapper, PIX4Dmatic): no header, commas, one image in each line:
//
//     image, latitude, longitude, height                                             4 fields
//     image, latitude, longitude, height, accuracy horz, accuracy vert               6
//     image, latitude, longitude, height, three angles                               7
//     image, latitude, longitude, height, three angles, accuracy horz, vert          9
//
// With projected coordinates x (easting) and y (northing) stand in place of latitude and longitude, and `crs` must be
// given. Degrees are WGS84; heights metres, above the ellipsoid unless `crs` has a vertical part. The angles are omega,
// phi, kappa in PIX4Dmapper, yaw, pitch, roll (0 = nadir) in PIX4Dmatic; a comment in the first line
// ("#imagename,...,yaw,pitch,roll") or `angles` in the project says which, else they are not used.
//
// Sources: support.pix4d.com, "Image geolocation and orientation import format" (360056389172) and "Geolocation file"
// of PIX4Dmapper; "Yaw, Pitch, Roll and Omega, Phi, Kappa angles".
#include <cmath>

#include "io/base/error.h"
#include "io/project/positions/position_fields.h"
#include "io/project/positions/position_formats.h"

namespace megablock {

namespace {

constexpr std::size_t kPix4dPlace = 4;  // fields of name and position

bool is_pix4d_row(const std::vector<std::string>& fields, Separator separator) {
  if (fields.size() < 3 || fields[0].empty() || is_number(fields[0])) return false;
  for (std::size_t f = 1; f < fields.size(); ++f)
    if (!is_number(with_decimal_point(fields[f], separator))) return false;
  return true;
}

bool is_pix4d(const PositionText& text) {
  for (const TextLine& line : text.lines) {
    if (line.text.front() == '#') continue;
    const Separator separator = separator_of(line.text);
    return separator != Separator::kBlanks && is_pix4d_row(split_fields(line.text, separator), separator);
  }
  return false;
}

std::optional<AngleKind> pix4d_angles(const PositionText& text) {
  const std::string first = lower_case(text.lines[0].text);
  if (first.front() != '#') return std::nullopt;
  if (first.find("omega") != std::string::npos) return AngleKind::kOmegaPhiKappa;
  if (first.find("yaw") != std::string::npos) return AngleKind::kBody;
  return std::nullopt;
}

PositionTable read_pix4d(const PositionText& text, const PositionOptions& options) {
  PositionTable table;
  const std::optional<AngleKind> kind = options.angles ? options.angles : pix4d_angles(text);
  bool angles = false;
  for (const TextLine& line : text.lines) {
    if (line.text.front() == '#') continue;
    const std::string where = text.where(line);
    const Separator separator = separator_of(line.text);
    const std::vector<std::string> fields = split_fields(line.text, separator);
    const std::size_t count = fields.size();
    if (count != 3 && count != kPix4dPlace && count != kPix4dPlace + 2 && count != kPix4dPlace + 3 &&
        count != kPix4dPlace + 5)
      throw InputError(
          where + ": " + std::to_string(count) +
          " fields in this line; expected image, latitude, longitude, height, then nothing, 2 accuracies, 3 "
          "angles, or 3 angles and 2 accuracies");
    const auto number = [&](std::size_t f, const char* what) {
      return position_number(fields[f], separator, what, where);
    };
    PositionTable::Row row;
    row.where = where;
    row.image = fields[0];
    const double first = number(1, "latitude or x"), second = number(2, "longitude or y");
    const bool degrees = options.crs != "local" && std::abs(first) <= 90 && std::abs(second) <= 180;
    if (!degrees && options.crs.empty())
      throw InputError(where + ": " + fields[1] + ", " + fields[2] +
                       " are no latitude and longitude; add 'crs: EPSG:...' beside 'file' in the project file");
    row.place.head<2>() = degrees ? Eigen::Vector2d(second, first) : Eigen::Vector2d(first, second);
    if (count >= kPix4dPlace) row.place.z() = number(3, "height");
    const bool has_angles = count == kPix4dPlace + 3 || count == kPix4dPlace + 5;
    angles = angles || has_angles;
    if (has_angles && kind) {
      row.angles_deg = {number(4, "first angle"), number(5, "second angle"), number(6, "third angle")};
      row.angles = *kind;
    }
    if (count == kPix4dPlace + 2 || count == kPix4dPlace + 5) read_sigmas(fields, count - 2, separator, where, row);
    table.rows.push_back(row);
  }
  if (angles && !kind)
    table.notes.push_back(text.path +
                          ": its angles are not used, because the file does not say what they are; add 'angles: "
                          "omega_phi_kappa' (PIX4Dmapper) or 'angles: yaw_pitch_roll' (PIX4Dmatic)");
  return table;
}

}  // namespace

const PositionFormat kPix4d = {"pix4d", "geolocation file of Pix4D", is_pix4d, read_pix4d};

}  // namespace megablock
