// Cells: which pairs are matched together.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

namespace megablock {

// Groups of at most `limit` places that lie in one rectangle each: the square of 2^24 units a side about the origin is
// halved, across x and y in turn, until a part holds no more than `limit`. The cuts are at fixed coordinates, so that a
// place added somewhere changes no group but its own. Groups in the order of the parts, places ascending within.
std::vector<std::vector<std::int64_t>> cells_of(const std::vector<Eigen::Vector2d>& places, std::int64_t limit);

}  // namespace megablock
