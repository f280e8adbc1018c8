// Gives addresses without memory, for tests of offsets beyond 2^31. In a program that links aliased_memory.cpp, every
// allocation of kAliasedFrom bytes or more (by operator new, so also of containers) has that many addresses, but only
// kAliasPeriod bytes of memory, which appear again and again. If offset arithmetic wraps around, it leaves the
// addresses and the program ends. A value is read back at its offset, unless another one was written at an offset that
// differs by a multiple of the period. The period is a number of pages but no power of two, so that neither parts of
// messages nor rows of matrices repeat with it.
#pragma once

#include <cstddef>

namespace megablock {

inline constexpr std::size_t kAliasedFrom = std::size_t{1} << 30, kAliasPeriod = std::size_t{4096} * 4099;

}  // namespace megablock
