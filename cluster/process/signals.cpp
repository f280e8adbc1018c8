#include "cluster/process/signals.h"

#include <signal.h>
#include <unistd.h>

#include <atomic>
#include <cstdlib>
#include <string_view>
#include <thread>

#include "cluster/process/exit_codes.h"
#include "cluster/process/progress.h"

namespace megablock {

namespace {

// A signal concerns the whole process, so that its flags cannot be local.
struct Flags {
  std::atomic<bool> stop{false}, begins_anew{false}, end_of_work{false};
};
Flags& flags() {
  static Flags flags;
  return flags;
}

void write_line(std::string_view text) {
  if (::write(STDERR_FILENO, text.data(), text.size()) < 0) {
    // Nothing is left to do: the terminal is gone, and the process ends.
  }
}

}  // namespace

void watch_signals() {
  sigset_t signals;
  sigemptyset(&signals);
  for (int signal : {SIGUSR1, SIGTERM, SIGINT}) sigaddset(&signals, signal);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  std::thread([signals] {
    for (;;) {
      int signal = 0;
      if (sigwait(&signals, &signal) != 0) continue;
      if (signal == SIGUSR1) {
        flags().stop = true;
        continue;
      }
      if (!flags().end_of_work) {
        end_progress_line();
        write_line(flags().begins_anew
                       ? "megablock: stopped; the same command begins anew\n"
                       : "megablock: stopped; the units in hand are abandoned, run the same command to resume\n");
      }
      std::_Exit(kExitInterrupted);
    }
  }).detach();
}

bool stop_requested() { return flags().stop; }
void work_begins_anew() { flags().begins_anew = true; }
void end_of_work() { flags().end_of_work = true; }

}  // namespace megablock
