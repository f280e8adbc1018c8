// Coordinate reference systems by PROJ: the block's local frame, and inputs in other systems.
//
// The local frame is topocentric (east, north, up; metres) about GroundFrame's origin, exact for any distance (it is a
// rotation and shift of geocentric coordinates). Every object has a PROJ context of its own: use one object from one
// thread at a time, and as many objects as threads.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <memory>
#include <string>

#include "io/block/block.h"

namespace megablock {

// WGS84; height above the ellipsoid.
struct Geodetic {
  double latitude_deg = 0, longitude_deg = 0, height_m = 0;
};

namespace detail {
class ProjTransform;
}

// Between WGS84 and the local frame of a georeferenced block (InputError when it is not).
class Georeference {
 public:
  explicit Georeference(const GroundFrame& ground);
  ~Georeference();
  Georeference(Georeference&&) noexcept;
  Georeference& operator=(Georeference&&) noexcept;

  Eigen::Vector3d to_local(const Geodetic& position) const;
  Geodetic to_geodetic(const Eigen::Vector3d& local) const;
  // Turns directions of the block's frame into the east-north-up frame at `position` (its own vertical): a rotation
  // R_cw that refers to the own vertical becomes R_cw * own_from_block(position) in the block.
  Eigen::Quaterniond own_from_block(const Geodetic& position) const;

 private:
  GroundFrame ground_;
  std::unique_ptr<detail::ProjTransform> transform_;
};

// From any system PROJ knows to WGS84. `crs`: "EPSG:25832", "EPSG:25832+5773" (with a vertical system), a PROJ string,
// WKT, "WGS84", or "WGS84 UTM 32N"; no other names, which PROJ would search for. Coordinates in the order x (easting or
// longitude), y (northing or latitude), z. Without a vertical system z is a height above the ellipsoid. InputError when
// PROJ does not know the system, or when a grid it needs (a geoid, say) is not installed: PROJ would otherwise hand
// back heights unchanged, silently.
class CrsToWgs84 {
 public:
  explicit CrsToWgs84(const std::string& crs);
  ~CrsToWgs84();
  CrsToWgs84(CrsToWgs84&&) noexcept;
  CrsToWgs84& operator=(CrsToWgs84&&) noexcept;

  Geodetic to_wgs84(const Eigen::Vector3d& xyz) const;  // InputError outside the system's range
  Eigen::Vector3d from_wgs84(const Geodetic& position) const;

 private:
  std::string crs_;
  std::unique_ptr<detail::ProjTransform> transform_;
};

}  // namespace megablock
