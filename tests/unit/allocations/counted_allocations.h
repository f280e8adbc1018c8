// Counts what the program takes from the heap: malloc and its kin themselves, which operator new and Eigen's matrices
// of dynamic size come down to. For programs of their own, without sanitizers, which bring a heap.
#pragma once

#include <cstdint>

namespace megablock {

// Of all threads, since the program began.
std::int64_t allocation_count();

}  // namespace megablock
