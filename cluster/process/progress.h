// Shows the progress of a stage on rank 0. On a terminal it is a bar with rate and remaining time, otherwise a plain
// line every few seconds: "features     12/24 images, 9 s, 1.3/s, 9 s left"
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <string>
#include <thread>
#include <utility>

namespace megablock {

class Progress {
 public:
  // There are `count` things called `name` to do; a thread polls `done`. With `quiet` nothing is printed.
  Progress(std::string stage, std::int64_t count, std::string name, std::function<std::int64_t()> done, bool quiet);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

 private:
  void print(std::int64_t done, bool last);
  double rate_per_second(std::int64_t done);

  std::string stage_;
  std::int64_t count_;
  std::string name_;
  std::function<std::int64_t()> done_;
  bool terminal_ = false;
  double start_s_ = 0;
  std::deque<std::pair<double, std::int64_t>> history_;  // times and counts of finished things
  std::size_t printed_width_ = 0;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

// Ends the line of the progress bar, if there is one. Call it before writing anything else to standard error.
void end_progress_line();

// Seconds on a clock that never goes back.
double monotonic_seconds();
// "42 s", "3 min 20 s", "5 h 12 min".
std::string duration_text(double seconds);

}  // namespace megablock
