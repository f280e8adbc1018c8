#include "cluster/process/arithmetic.h"

#include <cblas.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <opencv2/core.hpp>

#include "io/base/error.h"

namespace megablock {

namespace {

struct Setting {
  const char* name;
  const char* value;
};
constexpr const char* kCoreType = "OPENBLAS_CORETYPE";
constexpr const char* kAvx512Cores = "SkylakeX";
constexpr Setting kSettings[] = {
    {"OPENBLAS_NUM_THREADS", "1"},
    {"OPENCV_IPP", "disabled"},
    // Silences the remarks of Ceres on standard error. A unit that fails is reported with its reason by this program.
    {"GLOG_minloglevel", "3"},
    // For large images: keeps malloc from returning pages between the features of one image and the next, and fetching
    // them again. Huge pages are used where the system offers them (glibc 2.35, transparent huge pages at "madvise"): a
    // merge maps its fronts anew (use_memory_sparingly), and with pages of 4 KiB the system would take a third of its
    // time.
    {"GLIBC_TUNABLES",
     "glibc.malloc.mmap_threshold=1073741824:glibc.malloc.trim_threshold=2147483648:glibc.malloc.hugetlb=1"},
};
// Set unless the user has set it. Threads that wait for another one then leave the processor to it, or to other
// programs. Where other programs keep one of two cores busy, active waiting would cost most of the time.
constexpr Setting kWaiting = {"OMP_WAIT_POLICY", "passive"};
// Set only where the processor has AVX-512, because OpenCV complains about features that it cannot disable.
constexpr Setting kWithoutAvx512 = {"OPENCV_CPU_DISABLE", "AVX512-SKX"};

// Sets a variable of the environment. Returns true when it had this value already.
bool set(const Setting& setting) {
  const char* present = std::getenv(setting.name);
  if (present != nullptr && std::strcmp(present, setting.value) == 0) return true;
  setenv(setting.name, setting.value, 1);
  return false;
}

// The value of the option, wherever it stands on the command line. The parser of the command line checks it afterwards.
std::string wanted_level(int argc, char** argv) {
  const std::string option = kArithmeticOption;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (word == option && i + 1 < argc) return argv[i + 1];
    if (word.starts_with(option + "=")) return word.substr(option.size() + 1);
  }
  return kArithmeticLevels[0];
}

}  // namespace

std::string arithmetic_level() {
  const char* cores = std::getenv(kCoreType);
  return kArithmeticLevels[cores != nullptr && std::strcmp(cores, kAvx512Cores) == 0];
}

void pin_arithmetic(int argc, char** argv) {
  const bool wide = wanted_level(argc, argv) == "avx512";
  if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma"))
    throw InputError("this processor has no AVX2/FMA; jobs use the arithmetic level avx2: run on a newer processor");
  if (wide && !(__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
                __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl")))
    throw InputError("this processor has no AVX-512; leave out '--arithmetic avx512', or run on one that has");
  bool pinned = set({kCoreType, wide ? kAvx512Cores : "Haswell"});
  for (const Setting& setting : kSettings) pinned = set(setting) && pinned;
  if (__builtin_cpu_supports("avx512f")) pinned = set(kWithoutAvx512) && pinned;
  if (std::getenv(kWaiting.name) == nullptr) pinned = set(kWaiting);
  if (pinned) return;
  execv("/proc/self/exe", argv);  // returns only when it failed
  throw ComputeError(std::string("cannot start anew with pinned arithmetic (/proc/self/exe: ") + std::strerror(errno) +
                     "): the result could differ from other machines'; is /proc mounted?");
}

void limit_libraries_to_one_thread() {
  openblas_set_num_threads(1);
  cv::setNumThreads(1);
}

}  // namespace megablock
