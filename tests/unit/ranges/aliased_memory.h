// Addresses without memory, for tests of offsets beyond 2^31: a program that links aliased_memory.cpp gets every
// allocation of kAliasedFrom bytes or more (by operator new, so of containers too) as so many addresses, behind which
// the same kAliasPeriod bytes appear again and again. Offset arithmetic that wraps around leaves the addresses and ends
// the program; what is written at an offset is read there, unless something was written since at an offset that differs
// by a multiple of the period (pages, but no power of two: neither parts of messages nor rows of matrices repeat with
// it).
#pragma once

#include <cstddef>

namespace megablock {

inline constexpr std::size_t kAliasedFrom = std::size_t{1} << 30, kAliasPeriod = std::size_t{4096} * 4099;

}  // namespace megablock
