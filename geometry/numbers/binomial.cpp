#include "geometry/numbers/binomial.h"

#include <cmath>
#include <limits>

namespace megablock {

double log10_binomial_tail(std::int64_t trials, std::int64_t successes, double p) {
  if (successes <= 0) return 0;
  if (successes > trials || p <= 0) return -std::numeric_limits<double>::infinity();
  if (p >= 1) return 0;
  const auto n = static_cast<double>(trials), k = static_cast<double>(successes);
  // The sum starts at its first term, P(X = k). The logarithm of that term is computed, and the following terms are
  // kept as multiples of it: P(X = i + 1) / P(X = i) = (n - i) / (i + 1) * p / (1 - p). Where k lies far below the mean
  // n p the terms grow before they fall, so powers of ten are moved from the sum into `scale` before it overflows.
  const double log_first =
      std::lgamma(n + 1) - std::lgamma(k + 1) - std::lgamma(n - k + 1) + k * std::log(p) + (n - k) * std::log1p(-p);
  const double odds = p / (1 - p);
  double term = 1, sum = 1, scale = 0;
  for (double i = k; i < n; ++i) {
    term *= (n - i) / (i + 1) * odds;
    sum += term;
    if (sum > 1e200) {
      term *= 1e-200;
      sum *= 1e-200;
      scale += 200;
    }
    // From here on the terms fall faster than a geometric series would, so the rest cannot change the sum.
    if (term < 1e-17 * sum && (n - i) * odds < i + 1) break;
  }
  return std::fmin(0, log_first / std::log(10.0) + std::log10(sum) + scale);
}

}  // namespace megablock
