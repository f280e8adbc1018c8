// Gives the median of a list of values. For an even number of values it is the upper of the two middle ones, not their
// mean; the result is therefore always one of the values. Returns 0 for an empty list.
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
