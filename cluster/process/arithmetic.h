// The arithmetic level of a job: same bits on every processor that has it.
#pragma once

#include <string>

namespace megablock {

inline constexpr const char* kArithmeticLevels[] = {"avx2", "avx512"};
inline constexpr const char* kArithmeticOption = "--arithmetic";

// Of this process: what pin_arithmetic() has set. avx512 is faster in the dense algebra of the merge, and differs from
// avx2, the usual one, in the last digits.
std::string arithmetic_level();

// OpenBLAS and OpenCV choose kernels by processor when they load. Re-executes the program with the environment that
// pins both to the level that kArithmeticOption asks for, else avx2, unless it is already so. Throws InputError on a
// processor below the level.
void pin_arithmetic(int argc, char** argv);

// One BLAS thread per rank: threads belong to the units.
void limit_libraries_to_one_thread();

}  // namespace megablock
