// Memory of this process and host.
#pragma once

#include <string>

namespace megablock {

double peak_rss_mib();  // VmHWM of this process since the last reset
// Of its whole life, where each stage is also asked for its own.
class PeakMemory {
 public:
  void begin_stage();  // resets VmHWM, where the kernel allows it
  double mib() const;

 private:
  double before_mib_ = 0;  // until the stage began
};
void return_freed_memory();  // to the system: what malloc keeps of it
// What was freed goes back to the system, and from now on so does every block above 1 MiB as soon as it is freed. The
// program's malloc keeps such pages for the next image's features (arithmetic.cpp); from the tiles on, among tracks,
// tiles and thousands of fronts of all sizes, half of the process would lie idle between them.
void use_memory_sparingly();
// Undoes it: what is freed from now on is kept, as from the beginning of the program.
void keep_freed_memory();
// Every block of so many bytes and more, from now on.
void map_blocks_from(int bytes);
double host_memory_mib();  // MemTotal, or less where a control group (Slurm, container) limits it
// The least memory.max (version 2) or memory.limit_in_bytes (version 1) of a control group and those above it; infinity
// without limit. `list` as /proc/self/cgroup, `root` as /sys/fs/cgroup.
double control_group_memory_mib(const std::string& list, const std::string& root);
int host_cores();  // usable by this process

}  // namespace megablock
