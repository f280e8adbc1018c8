// Memory of this process and host.
#pragma once

#include <string>

namespace megablock {

double peak_rss_mib();     // VmHWM since the last reset
void reset_peak_rss();     // where the kernel allows it
// Returns what was freed to the system: memory that small blocks keep scattered through would otherwise stay with the
// process for good.
void give_back_memory();
double host_memory_mib();  // MemTotal, or less where a control group (Slurm, container) limits it
// The least memory.max (version 2) or memory.limit_in_bytes (version 1) of a control group and those above it; infinity
// without limit. `list` as /proc/self/cgroup, `root` as /sys/fs/cgroup.
double control_group_memory_mib(const std::string& list, const std::string& root);
int host_cores();  // usable by this process

}  // namespace megablock
