#include "io/project/inputs/geographic_fault.h"

#include <fmt/core.h>

#include <cmath>

#include "io/base/error.h"

namespace megablock {

namespace {

// Whether coordinates are degrees: they then are those of WGS84 but for the shift of the datum. A system may be defined
// on one continent only.
bool is_geographic(const CrsToWgs84& crs) {
  for (const Geodetic& place : {Geodetic{50, 10, 0}, Geodetic{40, -100, 0}, Geodetic{-25, 135, 0}}) {
    try {
      const Eigen::Vector3d xyz = crs.from_wgs84(place);
      if (std::abs(xyz.x() - place.longitude_deg) < 1 && std::abs(xyz.y() - place.latitude_deg) < 1) return true;
    } catch (const InputError&) {
      continue;
    }
  }
  return false;
}

}  // namespace

std::string geographic_fault(const CrsToWgs84& crs, const Eigen::Vector3d& xyz) {
  const double longitude = xyz.x(), latitude = xyz.y();
  const bool wrong_longitude = std::abs(longitude) > 360, wrong_latitude = std::abs(latitude) > 90;
  if ((!wrong_longitude && !wrong_latitude) || !is_geographic(crs)) return "";
  if (wrong_longitude)
    return fmt::format(
        "longitude {:.9g} is out of range [-180, 180]; correct it, or name the coordinate reference system that the "
        "coordinates are in",
        longitude);
  return fmt::format("latitude {:.9g} is out of range [-90, 90]; {}", latitude,
                     std::abs(longitude) <= 90 ? "are latitude and longitude exchanged?" : "correct it");
}

}  // namespace megablock
