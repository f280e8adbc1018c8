// Exact nearest neighbours between the descriptors of two images, both ways in one pass.
#pragma once

#include <cstdint>
#include <vector>

#include "io/block/features.h"

namespace megablock {

// The k nearest rows of the other set for every row, nearest first; ties: lower row first.
struct Neighbours {
  static constexpr std::int32_t kFar = 1 << 29;  // above every distance; with row -1: fewer than k neighbours exist
  std::size_t k = 0;
  std::vector<std::int32_t> distance;  // [rows * k], squared Euclidean
  std::vector<std::int32_t> row;       // [rows * k]
};

struct MutualNeighbours {
  Neighbours of_a, of_b;
};

// For which processors; the result is the same, to the bit.
enum class NearestKernel : std::uint8_t { kPortable, kAvx2, kAvx512 };
// The fastest that this processor runs.
NearestKernel fastest_nearest_kernel();

// k is 1 to 8. Of a kernel that the processor does not run, the fastest that it does.
MutualNeighbours nearest_neighbours(const std::vector<SiftDescriptor>& a, const std::vector<SiftDescriptor>& b,
                                    std::size_t k, NearestKernel kernel = fastest_nearest_kernel());

}  // namespace megablock
