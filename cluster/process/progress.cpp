#include "cluster/process/progress.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>

namespace megablock {

namespace {

std::atomic<bool>& line_is_open() {
  static std::atomic<bool> open{false};  // whether the line of the progress bar is unfinished; there is one terminal
  return open;
}

}  // namespace

void end_progress_line() {
  if (!line_is_open().exchange(false)) return;
  std::fputc('\n', stderr);
  std::fflush(stderr);
}

double monotonic_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

std::string duration_text(double seconds) {
  const auto whole = static_cast<long long>(seconds + 0.5);
  if (whole < 60) return std::to_string(whole) + " s";
  if (whole < 3600) return std::to_string(whole / 60) + " min " + std::to_string(whole % 60) + " s";
  return std::to_string(whole / 3600) + " h " + std::to_string(whole % 3600 / 60) + " min";
}

Progress::Progress(std::string stage, std::int64_t count, std::string name, std::function<std::int64_t()> done,
                   bool quiet)
    : stage_(std::move(stage)),
      count_(count),
      name_(std::move(name)),
      done_(std::move(done)),
      terminal_(isatty(STDERR_FILENO) != 0),
      start_s_(monotonic_seconds()),
      history_{{start_s_, 0}} {
  if (quiet || count == 0) return;
  thread_ = std::thread([this] {
    const double interval_s = terminal_ ? 0.25 : 5;
    double next_s = start_s_ + interval_s;
    while (!stop_) {
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
      if (monotonic_seconds() < next_s) continue;
      print(done_(), false);
      next_s = monotonic_seconds() + interval_s;
    }
  });
}

Progress::~Progress() {
  stop_ = true;
  if (!thread_.joinable()) return;
  thread_.join();
  if (terminal_) print(done_(), true);
}

// The rate over the last half minute. A resumed run counts its finished units at once; they soon drop out of the rate.
double Progress::rate_per_second(std::int64_t done) {
  constexpr double kWindow_s = 30;
  const double now_s = monotonic_seconds();
  history_.emplace_back(now_s, done);
  while (history_.size() > 2 && history_[1].first < now_s - kWindow_s) history_.pop_front();
  const double seconds = now_s - history_.front().first;
  return seconds > 0 ? static_cast<double>(done - history_.front().second) / seconds : 0;
}

void Progress::print(std::int64_t done, bool last) {
  done = std::clamp<std::int64_t>(done, 0, count_);
  const double elapsed = monotonic_seconds() - start_s_;
  std::string line = stage_;
  line.resize(std::max<std::size_t>(line.size(), 12), ' ');
  if (terminal_) {
    winsize size{};
    const int columns = ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
    const int width = std::clamp(columns - 58, 0, 40);
    const int filled = count_ > 0 ? static_cast<int>(width * done / count_) : width;
    if (width > 4) line += " [" + std::string(filled, '#') + std::string(width - filled, '.') + "]";
  }
  line += " " + std::to_string(done) + "/" + std::to_string(count_) + " " + name_ + ", " + duration_text(elapsed);
  const double rate = rate_per_second(done);
  if (!last && rate > 0) {
    std::array<char, 32> text{};
    std::snprintf(text.data(), text.size(), rate >= 1 ? ", %.1f/s" : ", %.1f/min", rate >= 1 ? rate : 60 * rate);
    line += text.data();
    line += ", " + duration_text(static_cast<double>(count_ - done) / rate) + " left";
  }
  if (terminal_) {
    const std::string padding(printed_width_ > line.size() ? printed_width_ - line.size() : 0, ' ');
    printed_width_ = line.size();
    line_is_open() = !last;
    std::fprintf(stderr, "\r%s%s%s", line.c_str(), padding.c_str(), last ? "\n" : "");
  } else {
    std::fprintf(stderr, "%s\n", line.c_str());
  }
  std::fflush(stderr);
}

}  // namespace megablock
