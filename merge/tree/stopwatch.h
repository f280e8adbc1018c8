// Measures the wall clock of the sweeps over the merge tree.
#pragma once

#include <chrono>

namespace megablock {

// Seconds on a clock that never goes back.
inline double clock_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// Adds the seconds of its own lifetime to a sum.
class Stopwatch {
 public:
  explicit Stopwatch(double& sum) : sum_(sum), start_(clock_seconds()) {}
  ~Stopwatch() { sum_ += clock_seconds() - start_; }
  Stopwatch(const Stopwatch&) = delete;
  Stopwatch& operator=(const Stopwatch&) = delete;

 private:
  double& sum_;
  const double start_;
};

}  // namespace megablock
