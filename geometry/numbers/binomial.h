// The binomial distribution.
#pragma once

#include <cstdint>

namespace megablock {

// Decimal logarithm of the probability of `successes` or more in `trials` of probability p each; a logarithm, as what
// is no accident has less than the smallest number. -infinity where it is impossible.
double log10_binomial_tail(std::int64_t trials, std::int64_t successes, double p);

}  // namespace megablock
