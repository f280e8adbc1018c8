// Median of a list: its upper middle value; 0 of an empty one.
#pragma once

#include <algorithm>
#include <vector>

namespace megablock {

inline double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace megablock
