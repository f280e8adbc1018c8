#include "cluster/process/process_memory.h"

#include <malloc.h>
#include <sched.h>
#include <sys/mman.h>

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <limits>
#include <string>

namespace megablock {

namespace {

// The value in KiB of a line "Name:   123 kB"; 0 when the line is missing.
double read_kib(const char* file, const std::string& name) {
  std::ifstream in(file);
  std::string line;
  while (std::getline(in, line))
    if (line.compare(0, name.size(), name) == 0) return std::stod(line.substr(name.size()));
  return 0;
}

}  // namespace

double peak_rss_mib() { return read_kib("/proc/self/status", "VmHWM:") / 1024; }

void PeakMemory::begin_stage() {
  before_mib_ = mib();
  std::ofstream("/proc/self/clear_refs") << "5";
}

double PeakMemory::mib() const { return std::max(before_mib_, peak_rss_mib()); }

void return_freed_memory() { malloc_trim(0); }

namespace {

// Divides the huge pages of the present heap. Otherwise a few bytes in use would keep a whole huge page in memory
// (arithmetic.cpp).
void divide_huge_pages_of_heap() {
  std::ifstream maps("/proc/self/maps");
  std::string line;
  while (std::getline(maps, line)) {
    unsigned long first = 0, last = 0;
    if (line.ends_with("[heap]") && std::sscanf(line.c_str(), "%lx-%lx", &first, &last) == 2)
      madvise(reinterpret_cast<void*>(first), last - first, MADV_NOHUGEPAGE);
  }
}

}  // namespace

void use_memory_sparingly() {
  constexpr int kLargeBlock = 1 << 20;
  map_blocks_from(kLargeBlock);
  divide_huge_pages_of_heap();
  return_freed_memory();
}

void keep_freed_memory() { map_blocks_from(1 << 30); }

void map_blocks_from(int bytes) { mallopt(M_MMAP_THRESHOLD, bytes); }

double host_memory_mib() {
  return std::min(read_kib("/proc/meminfo", "MemTotal:") / 1024,
                  control_group_memory_mib("/proc/self/cgroup", "/sys/fs/cgroup"));
}

double control_group_memory_mib(const std::string& list, const std::string& root) {
  double least = std::numeric_limits<double>::infinity();
  std::ifstream in(list);
  std::string line;
  while (std::getline(in, line)) {  // a line is number:controllers:path; version 2 names no controllers
    const std::size_t first = line.find(':'), second = line.find(':', first + 1);
    if (second == std::string::npos) continue;
    const std::string controllers = "," + line.substr(first + 1, second - first - 1) + ",";
    const bool unified = controllers == ",,";
    if (!unified && controllers.find(",memory,") == std::string::npos) continue;
    const std::string folder = unified ? root : root + "/memory";
    const char* file = unified ? "/memory.max" : "/memory.limit_in_bytes";
    for (std::string path = line.substr(second + 1); !path.empty(); path.resize(path.rfind('/'))) {
      double bytes = 0;
      if (std::ifstream(folder + (path == "/" ? "" : path) + file) >> bytes) least = std::min(least, bytes);
    }
  }
  return least / (1 << 20);
}

int host_cores() {
  cpu_set_t set;
  CPU_ZERO(&set);
  return sched_getaffinity(0, sizeof set, &set) == 0 ? CPU_COUNT(&set) : 1;
}

}  // namespace megablock
