// Numbers that no block has: slips of the pen, of a unit, of a converter. Internal to io/.
#pragma once

#include <Eigen/Core>
#include <string>

namespace megablock {

// InputError "where: what: ..." for
//   a coordinate that no place on Earth has, in metres or degrees of any system
void check_on_earth(double coordinate, const std::string& what, const std::string& where);
//   a place on a vehicle (antenna, camera of a rig) more than 1 km from its origin
void check_on_vehicle(const Eigen::Vector3d& place_m, const std::string& what, const std::string& where);
//   a rotation vector, in radians, of more than a full turn
void check_rotation_vector(const Eigen::Vector3d& vector, const std::string& what, const std::string& where);

}  // namespace megablock
