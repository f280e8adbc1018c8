#include "io/text/plausible.h"

#include <fmt/core.h>

#include <cmath>
#include <numbers>

#include "io/base/error.h"

namespace megablock {

void require_within(double value, const Limits& limits, const std::string& what, const std::string& otherwise) {
  if (!(value >= limits.least && value <= limits.most))
    throw InputError(fmt::format("{} must lie in [{:g}, {:g}]{}", what, limits.least, limits.most, otherwise));
}

void check_within(double value, const Limits& limits, const std::string& what, const std::string& where,
                  const std::string& otherwise) {
  require_within(value, limits, where + ": " + what, fmt::format("{}, not {:g}", otherwise, value));
}

void check_on_earth(double coordinate, const std::string& what, const std::string& where) {
  constexpr double kFarthest = 1e8;  // northings reach 1e7 m, eastings with the number of the zone in front 6e7 m
  if (!(std::abs(coordinate) <= kFarthest))
    throw InputError(
        fmt::format("{}: {}: {:g} is beyond any place on Earth; correct the number or its unit, or take the line out",
                    where, what, coordinate));
}

void check_on_vehicle(const Eigen::Vector3d& place_m, const std::string& what, const std::string& where) {
  constexpr double kFarthest_m = 1000;
  if (!(place_m.cwiseAbs().maxCoeff() <= kFarthest_m))
    throw InputError(
        fmt::format("{}: {}: [{:g}, {:g}, {:g}] m is no place on a vehicle (within 1 km of its origin); correct the "
                    "numbers or their unit",
                    where, what, place_m.x(), place_m.y(), place_m.z()));
}

Eigen::Quaterniond unit_rotation(const Eigen::Vector4d& wxyz, const std::string& where) {
  if (!(std::abs(wxyz.norm() - 1) <= 1e-3))
    throw InputError(where + ": qw,qx,qy,qz is not a unit quaternion; its norm must be 1 to within 0.001");
  const Eigen::Quaterniond rotation(wxyz[0], wxyz[1], wxyz[2], wxyz[3]);
  return std::abs(wxyz.squaredNorm() - 1) < 1e-15 ? rotation : rotation.normalized();
}

void check_rotation_vector(const Eigen::Vector3d& vector, const std::string& what, const std::string& where) {
  constexpr double kFullTurn = 2 * std::numbers::pi + 1e-6;
  if (!(vector.norm() <= kFullTurn))
    throw InputError(
        fmt::format("{}: {}: [{:g}, {:g}, {:g}] is more than a full turn; write the rotation vector in radians", where,
                    what, vector.x(), vector.y(), vector.z()));
}

}  // namespace megablock
