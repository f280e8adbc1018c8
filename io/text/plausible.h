// Numbers that no block has: slips of the pen, of a unit, of a converter.
#pragma once

#include <Eigen/Core>
#include <string>

namespace megablock {

// So wide that nobody who means his number meets them, so narrow that its square and inverse can be calculated with.
struct Limits {
  double least, most;
};
inline constexpr Limits kSigmaPx{1e-6, 1e4};
inline constexpr Limits kSigmaMetres{1e-8, 1e6};
inline constexpr Limits kSigmaDegrees{1e-9, 1e4};
inline constexpr Limits kInSigmas{1e-4, 1e6};  // residuals and corners of losses, in sigmas
inline constexpr Limits kFocalPx{1, 1e8};

// InputError "what must lie in [least, most]" + `otherwise`.
void require_within(double value, const Limits& limits, const std::string& what, const std::string& otherwise = "");
// The same with place and value: "where: what must ..., not value".
void check_within(double value, const Limits& limits, const std::string& what, const std::string& where,
                  const std::string& otherwise = "");

// InputError "where: what: ..." for
//   a coordinate that no place on Earth has, in metres or degrees of any system
void check_on_earth(double coordinate, const std::string& what, const std::string& where);
//   a place on a vehicle (antenna, camera of a rig) more than 1 km from its origin
void check_on_vehicle(const Eigen::Vector3d& place_m, const std::string& what, const std::string& where);
//   a rotation vector, in radians, of more than a full turn
void check_rotation_vector(const Eigen::Vector3d& vector, const std::string& what, const std::string& where);

}  // namespace megablock
