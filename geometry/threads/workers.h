// The threads of the process at work on what does not depend on one another. There are as many as OpenMP gives
// (omp_set_num_threads, by the program's `--threads`). What they make goes to a place of its own for every part and is
// summed up in the order of the parts, so that no bit depends on their number.
#pragma once

#include <omp.h>

#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

namespace megablock {

// Calls visit(i) for all i below `count`, on all threads. Exceptions wait until all have ended; the lowest i's is
// thrown.
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

// One T for each thread, made when it first asks for it.
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
