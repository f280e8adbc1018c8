// The memory of this process and of its host.
#pragma once

#include <string>

namespace megablock {

double peak_rss_mib();  // VmHWM of this process since the last reset
// Peak memory of the process over its whole life, which each stage asks for its own share.
class PeakMemory {
 public:
  void begin_stage();  // resets VmHWM, where the kernel allows it
  double mib() const;

 private:
  double before_mib_ = 0;  // until the stage began
};
void return_freed_memory();  // gives memory that malloc holds back to the system
// Gives freed memory back to the system, and from now on every block above 1 MiB as soon as it is freed. By default the
// program's malloc keeps such pages for the features of the next image (arithmetic.cpp). From the stage of tiles on,
// with tracks, tiles and thousands of fronts of all sizes, half of the process would lie idle between them.
void use_memory_sparingly();
// Returns to the default: freed memory stays with the process.
void keep_freed_memory();
// Gives back every block of so many bytes and more, from now on.
void map_blocks_from(int bytes);
double host_memory_mib();  // MemTotal, or less where a control group (Slurm, container) limits it
// The least memory.max (version 2) or memory.limit_in_bytes (version 1) of a control group and those above it; infinity
// without limit. `list` as /proc/self/cgroup, `root` as /sys/fs/cgroup.
double control_group_memory_mib(const std::string& list, const std::string& root);
int host_cores();  // usable by this process

}  // namespace megablock
