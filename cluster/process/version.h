// Gives the name and version of the program, which files, reports and --version state.
#pragma once

namespace megablock {

inline constexpr const char* kProgram = "megablock 0.1.0";

}  // namespace megablock
