// Names the exit codes of the program.
#pragma once

namespace megablock {

inline constexpr int kExitDone = 0;
inline constexpr int kExitFailedUnits = 1;   // finished, with failed units (listed)
inline constexpr int kExitBadInput = 2;      // wrong usage or input
inline constexpr int kExitInterrupted = 75;  // interrupted; the same command resumes

}  // namespace megablock
