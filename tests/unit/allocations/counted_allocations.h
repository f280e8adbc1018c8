// Counts the allocations on the heap. It replaces malloc and the related functions, which operator new and the dynamic
// matrices of Eigen call. Tests with it are separate programs without sanitizers, because these have a heap of their
// own.
#pragma once

#include <cstdint>

namespace megablock {

// Of all threads, since the program began.
std::int64_t allocation_count();

}  // namespace megablock
