#include "geometry/numbers/student.h"

#include <cmath>
#include <numbers>

namespace megablock {

namespace {

// log B(a, 1/2) = log Gamma(a) + log Gamma(1/2) - log Gamma(a + 1/2). For large a the difference of the two logarithms
// would cancel, so their asymptotic series is used.
double log_beta_half(double a) {
  const double ratio =
      a < 100 ? std::lgamma(a + 0.5) - std::lgamma(a) : 0.5 * std::log(a) - 1 / (8 * a) + 1 / (192 * a * a * a);
  return 0.5 * std::log(std::numbers::pi) - ratio;
}

// Regularised incomplete beta function I_x(a, b), by its continued fraction and the modified method of Lentz. The
// caller ensures x <= (a + 1) / (a + b + 2), where the fraction converges fast.
double lower_beta(double a, double b, double log_beta, double x) {
  if (x <= 0) return 0;
  const double log_front = a * std::log(x) + b * std::log1p(-x) - log_beta;
  // Lentz's method divides by c and d; a tiny value replaces zero.
  const auto not_zero = [](double v) { return std::abs(v) < 1e-300 ? 1e-300 : v; };
  double c = 1, d = 1 / not_zero(1 - (a + b) * x / (a + 1)), h = d;
  for (int m = 1; m < 100000; ++m) {
    const double even = m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m));
    d = 1 / not_zero(1 + even * d);
    c = not_zero(1 + even / c);
    h *= d * c;
    const double odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1));
    d = 1 / not_zero(1 + odd * d);
    c = not_zero(1 + odd / c);
    h *= d * c;
    if (std::abs(d * c - 1) < 1e-15) break;
  }
  return std::exp(log_front) * h / a;
}

// The value that is exceeded with the given probability. `exceeds` falls monotonically and is symmetric about 0, so
// doubling finds an upper bound and bisection the value.
template <typename Exceeds>
double quantile(double probability, const Exceeds& exceeds) {
  if (probability > 0.5) return -quantile(1 - probability, exceeds);
  double low = 0, high = 1;
  while (exceeds(high) > probability) high *= 2;
  for (int i = 0; i < 200 && high - low > 1e-15 * high; ++i) {
    const double middle = 0.5 * (low + high);
    (exceeds(middle) > probability ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace

double normal_exceeds(double value) { return 0.5 * std::erfc(value / std::sqrt(2.0)); }

double normal_quantile(double probability) { return quantile(probability, normal_exceeds); }

double student_exceeds(double value, double degrees) {
  if (value < 0) return 1 - student_exceeds(-value, degrees);
  const double a = 0.5 * degrees, square = value * value, x = degrees / (degrees + square);
  const double log_beta = log_beta_half(a);
  // I_x(a, 1/2) is computed directly or as 1 - I_{1-x}(1/2, a), whichever fraction converges fast.
  return 0.5 * (x <= (a + 1) / (a + 2.5) ? lower_beta(a, 0.5, log_beta, x)
                                         : 1 - lower_beta(0.5, a, log_beta, square / (degrees + square)));
}

double student_quantile(double probability, double degrees) {
  return quantile(probability, [degrees](double value) { return student_exceeds(value, degrees); });
}

}  // namespace megablock
