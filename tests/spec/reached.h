// Prints the figure that a test reaches beside the limit of its specification, so that docs/reference/methods.md can
// state it.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <string>

namespace megablock {

inline void expect_at_most(double reached, double limit, const std::string& what) {
  std::printf("[ reached  ] %s: %.4g, limit %.4g\n", what.c_str(), reached, limit);
  EXPECT_LE(reached, limit) << what;
}

inline void expect_at_least(double reached, double limit, const std::string& what) {
  std::printf("[ reached  ] %s: %.4g, limit %.4g\n", what.c_str(), reached, limit);
  EXPECT_GE(reached, limit) << what;
}

inline void expect_within(double reached, double expected, double off, const std::string& what) {
  std::printf("[ reached  ] %s: %.4g, limit %.4g +- %.4g\n", what.c_str(), reached, expected, off);
  EXPECT_NEAR(reached, expected, off) << what;
}

// The larger one, and for good what is not a number, which std::max passes over: EXPECT_LE then fails.
inline void keep_largest(double& largest, double value) {
  if (std::isnan(value) || value > largest) largest = value;
}
inline void keep_smallest(double& smallest, double value) {
  if (std::isnan(value) || value < smallest) smallest = value;
}

}  // namespace megablock
