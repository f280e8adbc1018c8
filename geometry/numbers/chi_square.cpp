#include "geometry/numbers/chi_square.h"

#include <cmath>

namespace megablock {

namespace {

// Regularised upper incomplete gamma function Q(a, x) = Gamma(a, x) / Gamma(a). The power series of 1 - Q converges
// fast for x < a + 1, the continued fraction of Q above. The fraction is evaluated by the modified method of Lentz.
double upper_gamma(double a, double x) {
  if (x <= 0) return 1;
  const double log_front = a * std::log(x) - x - std::lgamma(a);
  if (x < a + 1) {
    double term = 1 / a, sum = term;
    for (int n = 1; n < 100000 && term > 1e-17 * sum; ++n) sum += term *= x / (a + n);
    return 1 - sum * std::exp(log_front);
  }
  double b = x + 1 - a, c = 1e300, d = 1 / b, h = d;
  for (int i = 1; i < 100000; ++i) {
    const double an = -i * (i - a);
    b += 2;
    d = 1 / (an * d + b);
    c = b + an / c;
    const double factor = d * c;
    h *= factor;
    if (std::abs(factor - 1) < 1e-15) break;
  }
  return h * std::exp(log_front);
}

}  // namespace

double chi_square_exceeds(double statistic, double degrees) { return upper_gamma(0.5 * degrees, 0.5 * statistic); }

// The tail probability falls monotonically, so doubling finds an upper bound and bisection the value.
double chi_square_quantile(double probability, std::int64_t degrees) {
  const double a = 0.5 * static_cast<double>(degrees);
  double low = 0, high = static_cast<double>(degrees) + 10;
  while (upper_gamma(a, 0.5 * high) > probability) high *= 2;
  for (int i = 0; i < 200 && high - low > 1e-12 * high; ++i) {
    const double middle = 0.5 * (low + high);
    (upper_gamma(a, 0.5 * middle) > probability ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace megablock
