// Trajectories of the RGB-D benchmark of TU Munich, which many programs for simultaneous localisation and mapping
// write:
//
//     # timestamp tx ty tz qx qy qz qw
//     1305031102.1758 1.3405 0.6266 1.6575 0.6574 0.6126 -0.2949 -0.3248
//
// The position is that of the camera in the frame of the trajectory, metres, and the quaternion turns the axes of the
// camera (x right, y down, z along the view) into that frame. Times are seconds since 1970 or since any other moment.
//
// Source: J. Sturm et al., A benchmark for the evaluation of RGB-D SLAM systems, IROS 2012, and its page on file
// formats.
#include <cmath>

#include "io/base/error.h"
#include "io/project/positions/position_fields.h"
#include "io/project/positions/position_formats.h"
#include "io/text/plausible.h"
#include "io/text/settings_reader.h"

namespace megablock {

namespace {

constexpr std::size_t kTumFields = 8;

std::vector<std::string> tum_fields(const std::string& line) {
  return split_fields(line, line.find(',') == std::string::npos ? Separator::kBlanks : Separator::kComma);
}

bool is_tum(const PositionText& text) {
  for (const TextLine& line : text.lines) {
    if (line.text.front() == '#') continue;
    const std::vector<std::string> fields = tum_fields(line.text);
    if (fields.size() != kTumFields) return false;
    Eigen::Vector4d quaternion;
    for (std::size_t f = 0; f < kTumFields; ++f) {
      if (!is_number(fields[f])) return false;
      if (f >= 4) quaternion[static_cast<Eigen::Index>(f) - 4] = parse_number(fields[f], "", "");
    }
    return std::abs(quaternion.norm() - 1) < 1e-2;
  }
  return false;
}

PositionTable read_tum(const PositionText& text, const PositionOptions&) {
  PositionTable table;
  table.kind = PositionTable::Kind::kPath;
  table.crs = "local";
  for (const TextLine& line : text.lines) {
    if (line.text.front() == '#') continue;
    const std::string where = text.where(line);
    const std::vector<std::string> fields = tum_fields(line.text);
    if (fields.size() != kTumFields)
      throw InputError(where + ": " + std::to_string(fields.size()) +
                       " fields in this line; expected time tx ty tz qx qy qz qw");
    const auto number = [&](std::size_t field, const char* what) {
      return position_number(fields[field], Separator::kBlanks, what, where);
    };
    PositionTable::Row row;
    row.where = where;
    row.time_s = parse_number(fields[0], "time", where);
    row.place = {number(1, "tx"), number(2, "ty"), number(3, "tz")};
    row.rotation =
        unit_rotation({number(7, "qw"), number(4, "qx"), number(5, "qy"), number(6, "qz")}, where).conjugate();
    row.angles = AngleKind::kRotation;
    table.rows.push_back(std::move(row));
  }
  return table;
}

}  // namespace

const PositionFormat kTum = {"tum", "trajectory of the TUM benchmark", is_tum, read_tum};

}  // namespace megablock
