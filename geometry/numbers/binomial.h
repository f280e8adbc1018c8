// Gives the upper tail of the binomial distribution. Tests against chance use it: how likely is it that so many of n
// independent trials succeed by accident?
#pragma once

#include <cstdint>

namespace megablock {

// Decimal logarithm of P(X >= successes) = sum over i >= successes of C(n, i) p^i (1 - p)^(n - i), where n = `trials`
// and p is the probability of one success, in [0, 1]. The logarithm is returned because the probability of a clear
// structure is often below the smallest double. Boost.Math has no such logarithm, so that the sum is formed here.
// Returns -infinity where the event is impossible (more successes than trials, or p = 0).
double log10_binomial_tail(std::int64_t trials, std::int64_t successes, double p);

}  // namespace megablock
