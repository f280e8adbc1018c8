// Union-find over dense numbers; the representative of a set is its lowest member, whatever the order of joining.
#pragma once

#include <cstdint>
#include <numeric>
#include <vector>

namespace megablock {

class DisjointSets {
 public:
  explicit DisjointSets(std::int32_t size) : parent_(static_cast<std::size_t>(size)) {
    std::iota(parent_.begin(), parent_.end(), 0);
  }
  std::int32_t find(std::int32_t i) {
    while (at(i) != i) i = at(i) = at(at(i));
    return i;
  }
  // False when both were in one set already.
  bool join(std::int32_t i, std::int32_t j) {
    i = find(i), j = find(j);
    if (i == j) return false;
    at(i < j ? j : i) = i < j ? i : j;
    return true;
  }

 private:
  std::int32_t& at(std::int32_t i) { return parent_[static_cast<std::size_t>(i)]; }
  std::vector<std::int32_t> parent_;
};

}  // namespace megablock
