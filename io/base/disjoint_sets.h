// Unites and finds disjoint sets of the numbers 0 to count - 1 (union-find). The representative of a set is its lowest
// member, so the result does not depend on the order of the unions.
#pragma once

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <utility>
#include <vector>

namespace megablock {

class DisjointSets {
 public:
  explicit DisjointSets(std::int64_t count) : parent_(static_cast<std::size_t>(count)) {
    std::iota(parent_.begin(), parent_.end(), std::int64_t{0});
  }
  // The representative of a member's set. Shortens the path on its way.
  std::int64_t find(std::int64_t member) {
    while (at(member) != member) member = at(member) = at(at(member));
    return member;
  }
  // Unites two sets; returns whether they were different.
  bool unite(std::int64_t a, std::int64_t b) {
    a = find(a);
    b = find(b);
    if (a == b) return false;
    at(std::max(a, b)) = std::min(a, b);
    return true;
  }

 private:
  std::int64_t& at(std::int64_t i) { return parent_[static_cast<std::size_t>(i)]; }
  std::vector<std::int64_t> parent_;
};

}  // namespace megablock
