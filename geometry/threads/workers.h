// Runs independent pieces of work on all threads of the process. OpenMP decides their number (omp_set_num_threads, from
// the option `--threads`).
//
// Results must not depend on the number of threads. Every piece therefore writes to its own place, and the caller sums
// up in the order of the pieces.
#pragma once

#include <omp.h>

#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

namespace megablock {

// Calls visit(i) for all i in [0, count), on all threads, in no particular order. If calls throw, all others still run;
// then the exception of the lowest i is rethrown, so that the same error is reported in every run.
template <typename Visit>
void visit_in_parallel(std::int64_t count, Visit&& visit) {
  std::vector<std::exception_ptr> errors(static_cast<std::size_t>(count));
#pragma omp parallel for schedule(dynamic, 1)
  for (std::int64_t i = 0; i < count; ++i) {
    try {
      visit(i);
    } catch (...) {
      errors[static_cast<std::size_t>(i)] = std::current_exception();
    }
  }
  for (const std::exception_ptr& error : errors)
    if (error) std::rethrow_exception(error);
}

// One object of type T for each thread, for buffers that calls of visit_in_parallel reuse. mine() makes the object of
// the calling thread with `make` when the thread first asks for it.
template <typename T>
class PerThread {
 public:
  explicit PerThread(std::function<std::unique_ptr<T>()> make)
      : make_(std::move(make)), all_(static_cast<std::size_t>(omp_get_max_threads())) {}
  T& mine() {
    std::unique_ptr<T>& mine = all_[static_cast<std::size_t>(omp_get_thread_num())];
    if (!mine) mine = make_();
    return *mine;
  }

 private:
  std::function<std::unique_ptr<T>()> make_;
  std::vector<std::unique_ptr<T>> all_;
};

}  // namespace megablock
