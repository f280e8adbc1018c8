// Finds the exact nearest neighbours between the SIFT descriptors of two images, from a to b and from b to a in one
// pass.
#pragma once

#include <cstdint>
#include <vector>

#include "io/block/features.h"

namespace megablock {

// For every row of one set its k nearest rows of the other set, nearest first. Of equal distances the lower row is
// first.
struct Neighbours {
  // Above every distance; with row -1 it means that there are fewer than k neighbours.
  static constexpr std::int32_t kFar = 1 << 29;
  std::size_t k = 0;
  std::vector<std::int32_t> distance;  // [rows * k], squared Euclidean
  std::vector<std::int32_t> row;       // [rows * k]
};

struct MutualNeighbours {
  Neighbours of_a, of_b;
};

// The instruction sets for which there is a kernel. All give the same result, to the bit.
enum class NearestKernel : std::uint8_t { kPortable, kAvx2, kAvx512 };
// The fastest kernel that this processor can run.
NearestKernel fastest_nearest_kernel();

// Returns the k nearest neighbours both ways, 1 <= k <= 8; throws InputError for another k. A kernel that the processor
// cannot run is replaced by the fastest that it can.
MutualNeighbours nearest_neighbours(const std::vector<SiftDescriptor>& a, const std::vector<SiftDescriptor>& b,
                                    std::size_t k, NearestKernel kernel = fastest_nearest_kernel());

}  // namespace megablock
