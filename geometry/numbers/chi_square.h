// The chi-square distribution, by the regularised incomplete gamma function (series and continued fraction; Press et
// al., Numerical Recipes, 6.2).
#pragma once

#include <cstdint>

namespace megablock {

// Probability that a chi-square variable of these degrees of freedom (> 0) is above `statistic`.
double chi_square_exceeds(double statistic, double degrees);

// The value that is exceeded with this probability.
double chi_square_quantile(double probability, std::int64_t degrees);

}  // namespace megablock
