// Recognises numbers that no block can have: typing errors, wrong units, errors of converters.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <string>

namespace megablock {

// Limits so wide that no intended number exceeds them, and so narrow that its square and inverse can be calculated.
struct Limits {
  double least, most;
};
inline constexpr Limits kSigmaPx{1e-6, 1e4};
inline constexpr Limits kSigmaMetres{1e-8, 1e6};
inline constexpr Limits kSigmaDegrees{1e-9, 1e4};
inline constexpr Limits kInSigmas{1e-4, 1e6};  // residuals, and scales of robust losses, in standard deviations
inline constexpr Limits kFocalPx{1, 1e8};

// Throws InputError "what must lie in [least, most]", followed by `otherwise`.
void require_within(double value, const Limits& limits, const std::string& what, const std::string& otherwise = "");
// The same with place and value: "where: what must ..., not value".
void check_within(double value, const Limits& limits, const std::string& what, const std::string& where,
                  const std::string& otherwise = "");

// Throw InputError "where: what: ...". This one for a coordinate that no place on Earth has, in metres or degrees of
// any system.
void check_on_earth(double coordinate, const std::string& what, const std::string& where);
// For a position on a vehicle (antenna, camera of a rig) more than 1 km from its origin.
void check_on_vehicle(const Eigen::Vector3d& place_m, const std::string& what, const std::string& where);
// The unit quaternion w, x, y, z. Throws InputError if its norm differs from 1 by more than a thousandth: few digits
// make it a little longer or shorter, more than that is another convention, or angles. One that is normal to the last
// digits stays as it is, so that a written rotation comes back unchanged.
Eigen::Quaterniond unit_rotation(const Eigen::Vector4d& wxyz, const std::string& where);
// For a rotation vector (radians) of more than a full turn.
void check_rotation_vector(const Eigen::Vector3d& vector, const std::string& what, const std::string& where);

}  // namespace megablock
