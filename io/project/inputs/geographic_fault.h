// Explains why a geographic system has no such place. Internal to io/.
#pragma once

#include <Eigen/Core>
#include <string>

#include "io/block/crs.h"

namespace megablock {

// "latitude -91.995 is out of range [-90, 90]; are latitude and longitude exchanged?" for coordinates x = longitude,
// y = latitude. Empty where both are in range, and where the system is not geographic.
std::string geographic_fault(const CrsToWgs84& crs, const Eigen::Vector3d& xyz);

}  // namespace megablock
