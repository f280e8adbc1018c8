// Files of control and check points, three formats told apart by their content and name:
//
// * gcp_list.txt of ODM and OpenSfM: a first line with the coordinate reference system ("WGS84", "WGS84 UTM 32N",
//   "EPSG:25832", a PROJ string), then lines "x y z column row image [name ...]" between tabs or blanks (x = longitude
//   or easting; z may be NaN). Lines of the same name, or without one of the same coordinates, are one point. Columns
//   and rows count from 0 at the centre of the first pixel; we add 0.5.
// * ground_control_points.json of OpenSfM: latitude, longitude, altitude (WGS84, ellipsoidal, metres); image
// coordinates
//   about the image centre divided by max(width, height).
// * CSV (name ends in .csv): optional comment "# crs: EPSG:25832" ("local", the default, = the block's frame), a
// header,
//   and a line per measurement with the columns
//     name,x,y,z,image,column_px,row_px                       needed (z may be empty or NaN; x = easting or longitude)
//     role (control | check), sigma_horizontal_m, sigma_vertical_m, sigma_px    optional
//   Coordinates, role and sigmas may be left empty in later lines of a point. Pixel centres are at +0.5.
#pragma once

#include <string>
#include <vector>

#include "io/block/block.h"
#include "io/block/crs.h"

namespace megablock {

inline constexpr double kUnknownHeightSigma = 1000;  // metres: as good as free

// As read: coordinates in `crs`, images by name.
struct ControlTable {
  struct Measurement {
    std::string image;
    Eigen::Vector2d position;  // in the file's image coordinates
    double sigma_px = 0.5;
    std::string where;  // file:line
  };
  struct Point {
    std::string name;
    PointRole role = PointRole::kControl;
    Eigen::Vector3d coordinates;                                // x, y, z in `crs`; z NaN = unknown
    Eigen::Vector3d sigma = Eigen::Vector3d(0.02, 0.02, 0.03);  // metres
    std::vector<Measurement> measurements;
    std::string where;
  };
  enum class Pixels { kCentresAtHalf, kCentresAtInteger, kNormalised } pixels = Pixels::kCentresAtHalf;
  std::string crs = "local", crs_where;  // crs_where: file, and line where it is named
  std::vector<Point> points;
  std::vector<std::string> warnings;  // points left out
};

// InputError with file:line for malformed lines.
ControlTable read_control_table(const std::string& path);

// WGS84 positions of the points (unknown heights NaN), for choosing an origin; empty for local coordinates.
std::vector<Geodetic> geodetic_positions(const ControlTable& table);

// Adds the points to the block, in its ground frame. InputError with file:line for a measurement in an image that the
// block does not have, outside its image, two in one image, or coordinates that do not fit the block's frame. Images in
// `left_out` (unreadable or copies) lose their measurements with a warning.
void add_control(const ControlTable& table, const std::vector<std::string>& left_out, Block& block,
                 std::vector<std::string>& warnings);

// The CSV format above, coordinates in the block's frame ("local").
void write_control_csv(const std::string& path, const Block& block);

}  // namespace megablock
