// Measures the memory of this process and of its host, and gives back what the process does not need.
#pragma once

#include <string>

namespace megablock {

double peak_rss_mib();  // VmHWM of this process since the last reset
// The peak memory of the process over its whole life, although each stage resets the peak to find its own.
class PeakMemory {
 public:
  void begin_stage();  // resets VmHWM, where the kernel allows it
  double mib() const;

 private:
  double before_mib_ = 0;  // peak before the stage began
};
void return_freed_memory();  // gives freed memory that malloc holds back to the system
// Gives freed memory back to the system, and from now on every block above 1 MiB as soon as it is freed. By default the
// program's malloc keeps such pages for the features of the next image (arithmetic.cpp). From the stage of tiles on,
// with tracks, tiles and thousands of fronts of all sizes, half of the process would be idle memory between them.
void use_memory_sparingly();
// Returns to the default: freed memory stays with the process.
void keep_freed_memory();
// From now on, gives back every block of so many bytes or more as soon as it is freed.
void map_blocks_from(int bytes);
double host_memory_mib();  // MemTotal, or less where a control group (Slurm, container) limits it
// The smallest memory.max (version 2) or memory.limit_in_bytes (version 1) of a control group and of those above it;
// infinity without a limit. `list` is /proc/self/cgroup, `root` is /sys/fs/cgroup.
double control_group_memory_mib(const std::string& list, const std::string& root);
int host_cores();  // cores that this process may use

}  // namespace megablock
