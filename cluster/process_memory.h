// Memory of this process and host.
#pragma once

namespace megablock {

double peak_rss_mib();     // VmHWM since the last reset
void reset_peak_rss();     // where the kernel allows it
double host_memory_mib();  // MemTotal
int host_cores();          // usable by this process

}  // namespace megablock
