// The chi-square distribution against tables and against closed forms.
#include "geometry/numbers/chi_square.h"

#include <gtest/gtest.h>

#include <cmath>

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
  EXPECT_DOUBLE_EQ(chi_square_exceeds(0, 5), 1);
}

// For an even number of degrees of freedom the tail is a sum of Poisson probabilities.
TEST(ChiSquare, ProbabilitiesOfEvenDegrees) {
  for (const int half : {2, 20, 500}) {
    const double x = 1.05 * half;  // half of the statistic
    double sum = 0;
    for (int j = 0; j < half; ++j) sum += std::exp(j * std::log(x) - x - std::lgamma(j + 1));
    EXPECT_NEAR(chi_square_exceeds(2 * x, 2 * half), sum, 1e-9) << half;
  }
}

}  // namespace
}  // namespace megablock
