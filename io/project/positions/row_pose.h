// Gives position and attitude of the rows of a table, whichever system and angles state them. Internal to io/.
//
// Angles of the kinds kBody and kGimbal refer to true north. Omega, phi and kappa, and rotations, refer to the axes of
// the grid, in which true north has the bearing g (the convergence of the meridians):
//
//     R_own = R_grid M,    M = [cos g, sin g; -sin g, cos g] in the plane,
//
// because M turns the axes east, north at the place into those of the grid. A row with the offset o of the camera from
// the antenna has the position P + E' o, with P its place and E the axes east, north, up there.
#pragma once

#include <optional>
#include <string>

#include "io/block/crs.h"
#include "io/project/positions/position_table.h"

namespace megablock {

bool states_attitude(const PositionTable::Row& row);

// R_cw of a row with an attitude: from the axes that its angles refer to, to those of the camera or rig.
Eigen::Quaterniond rotation_of(const PositionTable::Row& row);

// The coordinate reference system of a table. The path is that of its file, for messages.
class SystemOfTable {
 public:
  // Throws InputError for a system that is not known.
  SystemOfTable(const std::string& crs, const std::string& path);

  bool local() const { return !crs_; }  // the block's own frame; the functions below are then not for it
  // The height is NaN where the row has none. Throws InputError with file:line for a place outside the system.
  Geodetic position(const PositionTable::Row& row) const;
  // Metres of one unit of x and y, and of z, of the system at a place; NaN where it has no such place.
  Eigen::Vector2d metres_per_unit(const Eigen::Vector3d& place) const;
  // R_own: from east, north, up at the position of the row.
  Eigen::Quaterniond rotation(const PositionTable::Row& row, const Geodetic& position) const;

 private:
  std::optional<CrsToWgs84> crs_;
};

}  // namespace megablock
