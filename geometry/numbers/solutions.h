// Holds a list of at most Capacity solutions of a minimal problem, in place. A solver runs millions of times in RANSAC
// and must not allocate memory. The interface is the part of std::vector that callers need.
#pragma once

#include <array>
#include <cassert>
#include <cstddef>

namespace megablock {

template <typename T, std::size_t Capacity>
class Solutions {
 public:
  using value_type = T;
  using const_iterator = const T*;

  // Capacity is the largest number of solutions that the problem can have, so a solver never exceeds it. A release
  // build ignores a solution beyond it; a debug build stops.
  void push_back(const T& solution) {
    assert(count_ < Capacity);
    if (count_ < Capacity) entries_[count_++] = solution;
  }
  std::size_t size() const { return count_; }
  bool empty() const { return count_ == 0; }
  const T& operator[](std::size_t i) const { return entries_[i]; }
  const T& front() const { return entries_[0]; }
  const T* begin() const { return entries_.data(); }
  const T* end() const { return entries_.data() + count_; }

 private:
  std::array<T, Capacity> entries_;
  std::size_t count_ = 0;
};

}  // namespace megablock
