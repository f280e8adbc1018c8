// The arithmetic level of a job. Results have the same bits on every processor that has this level.
#pragma once

#include <string>

namespace megablock {

inline constexpr const char* kArithmeticLevels[] = {"avx2", "avx512"};
inline constexpr const char* kArithmeticOption = "--arithmetic";

// The level of this process, as pin_arithmetic() has set it. avx512 is faster in the dense algebra of the merge; its
// last digits differ from those of avx2, the default.
std::string arithmetic_level();

// OpenBLAS and OpenCV choose their kernels by processor when they are loaded. This function re-executes the program
// with an environment that fixes both to the level of kArithmeticOption, else avx2, unless the environment is so
// already. Throws InputError on a processor below the level.
void pin_arithmetic(int argc, char** argv);

// One BLAS thread per rank, because the units use the threads.
void limit_libraries_to_one_thread();

}  // namespace megablock
