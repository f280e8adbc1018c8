// Transforms coordinates between reference systems, by PROJ: the local frame of the block, and input in other systems.
//
// The local frame is topocentric (east, north, up; metres) about the origin of GroundFrame. It is a rotation and a
// shift of geocentric coordinates and therefore exact at every distance. Every object has its own PROJ context: use an
// object in one thread at a time, and one object for each thread.
//
// With geocentric coordinates G of a point and G_0 of the origin, and the matrix E_0 whose rows are east, north and up
// at the origin, the local coordinates are E_0 (G - G_0). At another place E is another matrix: E E_0' turns directions
// of the block's frame into the axes there (own_from_block).
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <memory>
#include <string>

#include "io/block/block.h"

namespace megablock {

// A position in WGS84. The height is above the ellipsoid.
struct Geodetic {
  double latitude_deg = 0, longitude_deg = 0, height_m = 0;
};

namespace detail {
class ProjTransform;
}

// Transforms between WGS84 and the local frame of a georeferenced block. The constructor throws InputError for another
// block.
class Georeference {
 public:
  explicit Georeference(const GroundFrame& ground);
  ~Georeference();
  Georeference(Georeference&&) noexcept;
  Georeference& operator=(Georeference&&) noexcept;

  Eigen::Vector3d to_local(const Geodetic& position) const;
  Geodetic to_geodetic(const Eigen::Vector3d& local) const;
  // Rotation from directions in the block's frame to the east-north-up frame at `position`, which has its own vertical.
  // A rotation R_cw that refers to that vertical becomes R_cw * own_from_block(position) in the block.
  Eigen::Quaterniond own_from_block(const Geodetic& position) const;

 private:
  GroundFrame ground_;
  std::unique_ptr<detail::ProjTransform> transform_;
};

// Transforms between WGS84 and any system that PROJ knows. `crs` may be "EPSG:25832", "EPSG:25832+5773" (with a
// vertical system; also "EPSG:25832+EPSG:5773", "EPSG:4326+EGM96"), a PROJ string, also "+init=epsg:25832", WKT,
// "WGS84", or a UTM zone of WGS84, ETRS89 or NAD83 ("WGS84 UTM 32N", "WGS 84 / UTM zone 32 N"); other names are
// refused, because PROJ would search for them. Coordinates have the order x (easting or longitude), y (northing or
// latitude), z. Without a vertical system, z is a height above the ellipsoid. Throws InputError for an unknown system,
// and for one that needs a grid (a geoid, for example) that is not installed: PROJ would otherwise return unchanged
// heights without a word.
class CrsToWgs84 {
 public:
  explicit CrsToWgs84(const std::string& crs);
  ~CrsToWgs84();
  CrsToWgs84(CrsToWgs84&&) noexcept;
  CrsToWgs84& operator=(CrsToWgs84&&) noexcept;

  Geodetic to_wgs84(const Eigen::Vector3d& xyz) const;  // throws InputError outside the range of the system
  Eigen::Vector3d from_wgs84(const Geodetic& position) const;

 private:
  std::string crs_;
  std::unique_ptr<detail::ProjTransform> transform_;
};

}  // namespace megablock
