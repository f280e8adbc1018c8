#include "cluster/arithmetic.h"

#include <cblas.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <opencv2/core.hpp>

#include "io/error.h"

namespace megablock {

namespace {

struct Setting {
  const char* name;
  const char* value;
};
constexpr Setting kSettings[] = {
    {"OPENBLAS_CORETYPE", "Haswell"},
    {"OPENBLAS_NUM_THREADS", "1"},
    {"OPENCV_CPU_DISABLE", "AVX512_COMMON,AVX512_SKX,AVX512_KNL,AVX512_KNM,AVX512_CNL,AVX512_CLX,AVX512_ICL"},
    {"OPENCV_IPP", "disabled"},
    // Large images: keep malloc from returning and re-faulting pages between features of one image and the next.
    {"GLIBC_TUNABLES", "glibc.malloc.mmap_threshold=1073741824:glibc.malloc.trim_threshold=2147483648"},
};

}  // namespace

void pin_arithmetic(char** argv) {
  if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma"))
    throw InputError("this processor has no AVX2/FMA; jobs use the arithmetic level avx2: run on a newer processor");
  bool pinned = true;
  for (const Setting& setting : kSettings) {
    const char* present = std::getenv(setting.name);
    if (present != nullptr && std::strcmp(present, setting.value) == 0) continue;
    setenv(setting.name, setting.value, 1);
    pinned = false;
  }
  if (pinned) return;
  execv("/proc/self/exe", argv);  // returns only when it failed: go on unpinned rather than not at all
}

void limit_libraries_to_one_thread() {
  openblas_set_num_threads(1);
  cv::setNumThreads(1);
}

}  // namespace megablock
