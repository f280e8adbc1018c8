// Fixes the arithmetic level of a job. Results have the same bits on every processor that has this level.
#pragma once

#include <string>

namespace megablock {

inline constexpr const char* kArithmeticLevels[] = {"avx2", "avx512"};
inline constexpr const char* kArithmeticOption = "--arithmetic";

// The level of this process, as set by pin_arithmetic(). Level avx512 is faster in the dense algebra of the merge; its
// last digits differ from those of avx2, the default.
std::string arithmetic_level();

// OpenBLAS and OpenCV choose their kernels by processor when they are loaded. This function fixes both to the level of
// kArithmeticOption, else to avx2, by environment variables, and starts the program again unless they were set already.
// Throws InputError on a processor below the level.
void pin_arithmetic(int argc, char** argv);

// One BLAS thread per rank, because the units of a stage use the threads themselves.
void limit_libraries_to_one_thread();

}  // namespace megablock
