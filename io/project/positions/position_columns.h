// Reads rows of tables whose header names the columns, in the words of many programs. Internal to io/.
//
// The fields are
//
//     image                                       name of the image
//     latitude, longitude, height                 degrees, metres; or
//     x, y, z                                     easting or longitude, northing or latitude, height in the system
//     sigma_horizontal, sigma_x, sigma_y          metres; the larger of the last two stands for the first
//     sigma_vertical, sigma                       metres; the last one stands for whatever else is not given
//     yaw, pitch, roll                            degrees (kBody), or gimbal_yaw, ... (kGimbal), or omega, phi, kappa
//     qw, qx, qy, qz                              unit quaternion of R_cw: axes of the system -> camera or rig
//     sigma_roll, sigma_pitch, sigma_heading      degrees; sigma_rotation stands for whatever is not given
//     time, week                                  GPS seconds since 1970-01-01, or of a week; week of GPS
//     pass                                        number of the drive or flight line
//
// A name of a column is compared in lower case, without units in brackets, with '_' for everything that is no letter or
// digit, and without the ending _m or _deg. Other units of heights, sigmas and angles (column_units.h) are converted.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "io/project/positions/column_units.h"
#include "io/project/positions/position_table.h"
#include "io/text/text_lines.h"

namespace megablock {

class PositionColumns {
 public:
  PositionColumns() = default;
  // Finds the fields among the names of a header.
  explicit PositionColumns(const std::vector<std::string>& header);

  bool has(const std::string& field) const { return place_.contains(field); }
  bool has_place() const;         // latitude and longitude, or x and y
  bool geodetic() const;          // latitude and longitude
  bool has_sigmas() const;        // of positions
  bool has_angle_sigmas() const;  // of attitudes
  // `header`: the name of the column, which may state a unit; empty: none.
  void set(const std::string& field, std::size_t column, const std::string& header);
  // Throws InputError if the names of x and y state another unit than the system has. Heights stay in the unit of the
  // column where the system has them in this unit. `crs`: of the rows; `path`, `where`: of the file and its header.
  void fit_to_system(const std::string& crs, const std::string& path, const std::string& where,
                     std::vector<PositionTable::Row>& rows) const;

  // The row of a line; nothing if it has neither image nor time, or no coordinates, as programs write images without
  // position.
  // `other`: what yaw, pitch and roll are, if not kBody. Throws InputError for values that are not numbers.
  std::optional<PositionTable::Row> row(const std::vector<std::string>& fields, Separator separator,
                                        const std::string& where, std::optional<AngleKind> other = {}) const;

  static bool is_field(const std::string& name);
  static std::string fields();  // all names, for messages

 private:
  struct Column {
    std::size_t at = 0;
    ColumnUnit unit = {};
    std::string header = {};
  };
  struct Texts;
  static void set_time(const Texts& of, PositionTable::Row& row);
  static void set_sigmas(const Texts& of, PositionTable::Row& row);
  static void set_attitude(const Texts& of, std::optional<AngleKind> other, PositionTable::Row& row);

  const char* height_field() const { return has("height") ? "height" : "z"; }

  std::map<std::string, Column> place_;  // by field
};

}  // namespace megablock
