// Keeping factors between the upward and the downward pass within a byte budget: in memory while they fit, else in a
// scratch directory, else not at all (recomputed on the way down). The choice never changes tiles or bits.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>

#include "merge/bytes.h"

namespace megablock {

struct MemoryOptions {
  std::int64_t factor_bytes = std::int64_t{4} << 30;  // budget of kept factors; <= 0 keeps none
  std::string scratch_directory;                      // for spilling; empty: recompute instead
};

struct MemoryStatistics {
  std::int64_t kept = 0, spilled = 0, recomputed = 0;  // factors
  std::int64_t peak_bytes = 0;                         // of kept factors
};

}  // namespace megablock
