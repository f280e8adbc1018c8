// Decides when to save unfinished work: at least a second after the last time, and so seldom that saving takes at most
// a twentieth of the time.
#pragma once

#include <algorithm>

#include "cluster/process/progress.h"

namespace megablock {

class SaveTimes {
 public:
  bool due() const { return monotonic_seconds() >= next_s_; }
  template <typename Save>
  void run(const Save& save) {
    const double start = monotonic_seconds();
    save();
    const double end = monotonic_seconds();
    next_s_ = end + std::max(kInterval_s, 20 * (end - start));
  }

 private:
  static constexpr double kInterval_s = 1;
  double next_s_ = monotonic_seconds() + kInterval_s;
};

}  // namespace megablock
