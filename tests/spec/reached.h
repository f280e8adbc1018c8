// The figure a test reaches beside the limit of its specification, printed so that docs/features.md can state it.
#pragma once

#include <gtest/gtest.h>

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

}  // namespace megablock
