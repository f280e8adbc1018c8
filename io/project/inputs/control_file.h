// Reads files of control and check points, and adds the points to a block. The ending of the name tells the format:
//
// * .csv: our own format. An optional comment "# crs: EPSG:25832" names the coordinate reference system; the default
//   "local" is the block's ground frame. Then follow a header and a line per measurement, with the columns
//     name,x,y,z,image,column_px,row_px       required (x = easting or longitude; z may be empty or NaN)
//     role (control | check), sigma_horizontal_m, sigma_vertical_m, sigma_px    optional
//   Later lines of a point may leave coordinates, role and sigmas empty. Pixel centres are at +0.5.
// * .json: ground_control_points.json of OpenSfM. Positions are latitude, longitude and altitude (WGS84, ellipsoidal
//   height, metres). Image coordinates refer to the image centre and are divided by max(width, height).
// * any other name, and .csv whose first line has one field: gcp_list.txt of ODM and OpenSfM
//   (docs.opendronemap.org/gcp). The first line names the coordinate reference system (io/block/crs.h). The other lines
//   are "x y z column row image [name ...]" (x = easting or longitude; z may be NaN), separated by blanks, tabs, commas
//   or semicolons; numbers may have decimal commas where commas do not separate. The line below the first may name the
//   columns. Lines with the same name, or without names but with the same coordinates, belong to one point. Columns and
//   rows count from 0 at the centre of the first pixel; we add 0.5.
//
// Heights are above the ellipsoid unless the system has a vertical part. io/text/text_lines.h says which files are
// text, io/project/inputs/image_lookup.h which names of images are understood.
//
// In our pixels the centre of the first one is (0.5, 0.5), so the image spans [0, w] x [0, h]. The two other
// conventions become
//
//     columns and rows from 0 at the first centre    (u, v) = (column, row) + (0.5, 0.5)
//     normalised, origin in the middle of the image  (u, v) = max(w, h) (x, y) + (w, h) / 2
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "io/block/block.h"
#include "io/block/crs.h"

namespace megablock {

// The contents of a file: coordinates in the system `crs`, images by name.
struct ControlTable {
  struct Measurement {
    std::string image;
    Eigen::Vector2d position;  // in the image coordinates of the file (`pixels`)
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
  std::string path;                      // of the file
  std::string crs = "local", crs_where;  // crs_where: the file, with the line if a line names the system
  std::vector<Point> points;
  std::vector<std::string> warnings;  // about points that were left out
};

// Reads a file. Throws InputError with file:line for malformed lines.
ControlTable read_control_table(const std::string& path);

// The WGS84 positions of the points (unknown heights are NaN), to choose an origin. Empty for local coordinates.
std::vector<Geodetic> geodetic_positions(const ControlTable& table);

// Adds the points to the block, in its ground frame. Measurements in images of `left_out` (unreadable files or copies)
// and in images that the block does not have are dropped with a warning. Throws InputError with file:line if no
// measurement is in an image of the block, for one outside its image, for two of one point in one image, and for
// coordinates that do not fit the block's frame.
void add_control(const ControlTable& table, const std::vector<std::string>& left_out, Block& block,
                 std::vector<std::string>& warnings);

// Where the points would lie in the block's ground frame if x and y of the file were exchanged (longitude and latitude,
// easting and northing); nothing for a point that the system has no such place for.
std::vector<std::optional<Eigen::Vector3d>> exchanged_places(const ControlTable& table, const Block& block);

// Writes the CSV format above, with coordinates in the block's ground frame ("local").
void write_control_csv(const std::string& path, const Block& block);

}  // namespace megablock
