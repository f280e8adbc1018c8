// Divides places on the ground into cells. The pairs of one cell are matched together.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

namespace megablock {

// Groups places so that each group has at most `limit` of them and lies in one rectangle. The square with a side of
// 2^24 units about the origin is halved, across x and y in turn, until no part has more than `limit`. The cuts have
// fixed coordinates, so a new place changes no group but its own. The groups have the order of the parts; the places
// within are ascending.
std::vector<std::vector<std::int64_t>> cells_of(const std::vector<Eigen::Vector2d>& places, std::int64_t limit);

}  // namespace megablock
