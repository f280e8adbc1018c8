// Exit codes of the program.
#pragma once

namespace megablock {

inline constexpr int kExitDone = 0;
inline constexpr int kExitFailedUnits = 1;   // finished, with failed units (listed)
inline constexpr int kExitBadInput = 2;      // usage or bad input
inline constexpr int kExitInterrupted = 75;  // interrupted and resumable

}  // namespace megablock
