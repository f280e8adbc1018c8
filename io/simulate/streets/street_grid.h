// Gives the plan of the street scene, which drives, tie points and rendered houses share.
//
// The axes of the streets are x = i S and y = j S for all integers i, j, where S is the spacing. Houses stand on the
// ground between them, up to about kFacade metres from the axes.
// Internal to io/: it is not installed.
#pragma once

#include "io/simulate/scene/simulated_block.h"
#include "io/simulate/scene/simulation_options.h"
#include "io/simulate/scene/terrain.h"

namespace megablock {

inline constexpr double kFacade = 9;         // mean distance of the facades from the axis, metres
inline constexpr double kFacadeDepth = 1.5;  // largest distance of a house from this mean, metres
inline constexpr double kHouse = 12;         // length of a house, metres

// The number of the nearest street axis in one coordinate, and the distance to it. std::round is not used, because it
// is a slow call with the baseline instruction set.
inline std::int64_t nearest_axis(double x, double spacing) {
  return static_cast<std::int64_t>(x / spacing + (x < 0 ? -0.5 : 0.5));
}
inline double off_axis(double x, double spacing) {
  return std::abs(x - spacing * static_cast<double>(nearest_axis(x, spacing)));
}

// The distance of the facade from the axis at a place of a street. Each house has its own distance.
inline double facade_distance(std::uint64_t seed, bool street_along_x, std::int64_t axis, int side, double place) {
  const auto house = static_cast<std::uint64_t>(static_cast<std::int64_t>(std::floor(place / kHouse)));
  const auto street = static_cast<std::uint64_t>(axis * 4 + (street_along_x ? 2 : 0) + (side > 0 ? 1 : 0));
  // A hash instead of a stored list: the distance of any house is known without the others, and tie points and rendered
  // houses agree on it. The last factor maps 53 bits to [0, 2), so the result is kFacade +- kFacadeDepth.
  const std::uint64_t bits = mix_bits(mix_bits(seed + house) + street);
  return kFacade + kFacadeDepth * (static_cast<double>(bits >> 11) * 0x1p-52 - 1);
}

inline Terrain street_terrain(const SimulationOptions& options) {
  // Street blocks of this scene are nearly level; the Stereopolis scene has the full relief.
  const double share = options.scene == SimulationOptions::Scene::kStreet ? 0.2 : 1;
  return Terrain(options.seed, share * options.terrain_relief_m, 400);
}

}  // namespace megablock
