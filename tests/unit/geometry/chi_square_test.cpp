#include "geometry/chi_square.h"

#include <gtest/gtest.h>

namespace megablock {
namespace {

TEST(ChiSquare, QuantilesOfTables) {
  EXPECT_NEAR(chi_square_quantile(0.05, 1), 3.841458821, 1e-8);
  EXPECT_NEAR(chi_square_quantile(0.001, 10), 29.58829845, 1e-7);
  EXPECT_NEAR(chi_square_quantile(0.5, 100), 99.33412924, 1e-7);
}

TEST(ChiSquare, ProbabilitiesOfTables) {
  EXPECT_NEAR(chi_square_exceeds(3.841458821, 1), 0.05, 1e-9);
  EXPECT_NEAR(chi_square_exceeds(29.58829845, 10), 0.001, 1e-9);
  EXPECT_NEAR(chi_square_exceeds(1067.6, 1000), 0.0679, 2e-4);  // Wilson and Hilferty (1931): z = 1.4917
  EXPECT_DOUBLE_EQ(chi_square_exceeds(0, 5), 1);
}

}  // namespace
}  // namespace megablock
