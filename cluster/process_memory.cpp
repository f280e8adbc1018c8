#include "cluster/process_memory.h"

#include <sched.h>

#include <cstdio>
#include <fstream>
#include <string>

namespace megablock {

namespace {

// Value in KiB of a "Name:   123 kB" line; 0 when it is not there.
double read_kib(const char* file, const std::string& name) {
  std::ifstream in(file);
  std::string line;
  while (std::getline(in, line))
    if (line.compare(0, name.size(), name) == 0) return std::stod(line.substr(name.size()));
  return 0;
}

}  // namespace

double peak_rss_mib() { return read_kib("/proc/self/status", "VmHWM:") / 1024; }

void reset_peak_rss() { std::ofstream("/proc/self/clear_refs") << "5"; }

double host_memory_mib() { return read_kib("/proc/meminfo", "MemTotal:") / 1024; }

int host_cores() {
  cpu_set_t set;
  CPU_ZERO(&set);
  return sched_getaffinity(0, sizeof set, &set) == 0 ? CPU_COUNT(&set) : 1;
}

}  // namespace megablock
