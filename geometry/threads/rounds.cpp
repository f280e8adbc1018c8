#include "geometry/threads/rounds.h"

#include <omp.h>

#include <condition_variable>
#include <exception>
#include <mutex>
#include <vector>

namespace megablock {

namespace {

class RoundWorkers {
 public:
  explicit RoundWorkers(const Rounds& rounds)
      : rounds_(rounds), states_(static_cast<std::size_t>(rounds.count)), threads_(omp_get_max_threads()) {}

  // Of one thread, until nothing is left to do.
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
    bool taken = false;       // somebody makes it ready or has done so
    std::int64_t parts = -1;  // -1: not ready
    std::int64_t begun = 0, done = 0;
    std::exception_ptr error;
    std::int64_t error_part = 0;
  };
  using Lock = std::unique_lock<std::mutex>;

  State& state(std::int64_t round) { return states_[static_cast<std::size_t>(round)]; }
  // Of the rounds that are open. One thread alone never lacks work.
  std::int64_t end() const {
    const std::int64_t next = first_ + 1;
    return next < rounds_.count && threads_ > 1 && rounds_.ahead(next) ? next + 1 : next;
  }

  // Runs `call` without the lock; its error.
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

  // These three take what there is to do of one kind; false: nothing.

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
  std::int64_t first_ = 0;  // round that is to be finished next
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
