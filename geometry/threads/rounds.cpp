#include "geometry/threads/rounds.h"

#include <omp.h>

#include <condition_variable>
#include <exception>
#include <mutex>
#include <vector>

namespace megablock {

namespace {

// All threads share this object and its mutex. Each thread repeatedly takes the most urgent piece of work: finishing
// the first open round, then preparing an open round, then a part of one. A thread waits only if there is none of
// these.
class RoundWorkers {
 public:
  explicit RoundWorkers(const Rounds& rounds)
      : rounds_(rounds), states_(static_cast<std::size_t>(rounds.count)), threads_(omp_get_max_threads()) {}

  // The loop of one thread. It ends when all rounds are finished or one has failed.
  void work() {
    std::unique_lock lock(mutex_);
    while (first_ < rounds_.count && !error_)
      if (!finish_first(lock) && !prepare_next(lock) && !visit_next(lock)) changed_.wait(lock);
  }
  void rethrow() const {
    if (error_) std::rethrow_exception(error_);
  }

 private:
  struct State {
    bool taken = false;       // a thread prepares the round or has prepared it
    std::int64_t parts = -1;  // number of parts; -1 before the round is prepared
    std::int64_t begun = 0, done = 0;
    std::exception_ptr error;
    std::int64_t error_part = 0;
  };
  using Lock = std::unique_lock<std::mutex>;

  State& state(std::int64_t round) { return states_[static_cast<std::size_t>(round)]; }
  // One past the last round that may be worked on: the first unfinished round and, if `ahead` permits, the next. A
  // single thread never works ahead; it would only hold two rounds in memory.
  std::int64_t end() const {
    const std::int64_t next = first_ + 1;
    return next < rounds_.count && threads_ > 1 && rounds_.ahead(next) ? next + 1 : next;
  }

  // Runs `call` with the mutex released and returns its exception, if any.
  template <typename Call>
  static std::exception_ptr unlocked(Lock& lock, const Call& call) {
    std::exception_ptr error;
    lock.unlock();
    try {
      call();
    } catch (...) {
      error = std::current_exception();
    }
    lock.lock();
    return error;
  }

  // Each of the following functions does one piece of work of its kind. They return false if there is none.

  bool finish_first(Lock& lock) {
    State& round = state(first_);
    if (finishing_ || round.done != round.parts) return false;
    finishing_ = true;
    error_ = round.error ? round.error : unlocked(lock, [&] { rounds_.finish(first_); });
    finishing_ = false;
    ++first_;
    changed_.notify_all();
    return true;
  }

  bool prepare_next(Lock& lock) {
    for (std::int64_t r = first_; r < end(); ++r) {
      State& round = state(r);
      if (round.taken) continue;
      round.taken = true;
      std::int64_t parts = 0;
      round.error = unlocked(lock, [&] { parts = rounds_.prepare(r); });
      round.error_part = -1;
      round.parts = round.error ? 0 : parts;
      changed_.notify_all();
      return true;
    }
    return false;
  }

  bool visit_next(Lock& lock) {
    for (std::int64_t r = first_; r < end(); ++r) {
      State& round = state(r);
      if (round.begun >= round.parts) continue;
      const std::int64_t part = round.begun++;
      const std::exception_ptr error = unlocked(lock, [&] { rounds_.visit(r, part); });
      // The error of the lowest part wins, whatever the order in which the parts ended; the message is then the same in
      // every run.
      if (error && (!round.error || part < round.error_part)) {
        round.error = error;
        round.error_part = part;
      }
      if (++round.done == round.parts) changed_.notify_all();
      return true;
    }
    return false;
  }

  const Rounds& rounds_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<State> states_;
  const int threads_;
  std::int64_t first_ = 0;  // the round to be finished next
  bool finishing_ = false;
  std::exception_ptr error_;
};

}  // namespace

void visit_in_rounds(const Rounds& rounds) {
  RoundWorkers workers(rounds);
#pragma omp parallel
  workers.work();
  workers.rethrow();
}

}  // namespace megablock
