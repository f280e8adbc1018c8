// Gives tail probabilities and quantiles of the chi-square distribution, for tests of variances and of squared
// residuals.
//
// With d degrees of freedom, P(X > s) = Q(d / 2, s / 2), where Q is the regularised upper incomplete gamma function
// as Boost.Math computes it.
#pragma once

#include <cstdint>

namespace megablock {

// Returns the probability that a chi-square variable with `degrees` degrees of freedom (> 0) exceeds `statistic`.
double chi_square_exceeds(double statistic, double degrees);

// Returns the value that such a variable exceeds with this probability, 0 < probability < 1.
double chi_square_quantile(double probability, std::int64_t degrees);

}  // namespace megablock
