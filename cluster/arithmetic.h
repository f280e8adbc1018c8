// The arithmetic level of a job: same bits on every processor that has it (architecture.md section 5).
#pragma once

#include <string>

namespace megablock {

inline constexpr const char* kArithmeticLevel = "avx2";

// OpenBLAS and OpenCV choose kernels by processor when they load. Re-executes the program with the environment that
// pins both to the AVX2 level, unless it is already so. Throws InputError on a processor without AVX2 and FMA.
void pin_arithmetic(char** argv);

// One BLAS thread per rank: threads belong to the units.
void limit_libraries_to_one_thread();

}  // namespace megablock
