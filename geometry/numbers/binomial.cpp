#include "geometry/numbers/binomial.h"

#include <cmath>
#include <limits>

namespace megablock {

double log10_binomial_tail(std::int64_t trials, std::int64_t successes, double p) {
  if (successes <= 0) return 0;
  if (successes > trials || p <= 0) return -std::numeric_limits<double>::infinity();
  if (p >= 1) return 0;
  const auto n = static_cast<double>(trials), k = static_cast<double>(successes);
  // The first term as a logarithm, the others as multiples of it; where k is far below n p these grow beyond all bounds
  // first, so that powers of ten are taken out of them.
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
    if (term < 1e-17 * sum && (n - i) * odds < i + 1) break;
  }
  return std::fmin(0, log_first / std::log(10.0) + std::log10(sum) + scale);
}

}  // namespace megablock
